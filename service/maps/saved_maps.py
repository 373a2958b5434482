"""A saved map as a command changes it: what is saved goes on from what was loaded, or nothing is."""

from pathlib import Path

from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.optimising import OptimisingConfig
from wayfi.frontends.odometry.odometry_config import calibration_prior
from wayfi.recordings.files.map_folder import MapError
from wayfi.recordings.map.loading import LoadedMap
from wayfi.recordings.map.manifest import MapName, read_manifest
from wayfi.recordings.map.saving import save_map
from wayfi.service.config import Config


def optimising(config: Config) -> OptimisingConfig:
    """What a map is optimised with."""
    return OptimisingConfig(config.backend, config.map, calibration_prior(config.odometry))


def save_edited(
    loaded: LoadedMap, building: BuildingMap, config: Config, name: MapName | None = None, out: Path | None = None
) -> MapName:
    """Save what has become of a map, into `out` or in its place, as its next version; returns its name.

    Raises MapError where another program has saved the map meanwhile: its work would be lost.
    """
    if out is None and read_manifest(loaded.folder).map_version != loaded.map_version:
        raise MapError(f"{loaded.folder}: was saved by another program meanwhile; nothing is changed: try again")
    return save_map(out or loaded.folder, building, config.map, name or loaded.name)
