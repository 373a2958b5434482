"""The localizer that is measured."""

from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.slam_config import SlamConfig


def localizer(building: BuildingMap, config: SlamConfig) -> Pipeline:
    """The pipeline in the mode of localisation, in the map `building`."""
    return Pipeline(config, building=building)
