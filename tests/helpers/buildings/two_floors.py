"""A building of two floors with an elevator: a map of both, and drives of another day through them."""

from functools import cache

from buildings.elevators import ridden
from buildings.robots import drive as driven
from buildings.storey import ROUTE, Storey, storey
from drives import Arrival

from wayfi.frontends.events import Event
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.measurements import WifiScan
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.result import DriveEstimate
from wayfi.frontends.slam_config import SlamConfig

OTHER_FURNITURE = 7


def floor_of_building(floor: int, identical: bool = False) -> Storey:
    """Floor 0 or 1: other access points on each, and other furniture unless they are identical."""
    place = storey(floor)
    return place.refurnished(0 if identical else OTHER_FURNITURE * floor)


def part(floor: int, day: int, first: int = 0, corners: int = 99, identical: bool = False) -> list[Arrival]:
    """A drive through a floor, from one corner of the route over the next ones."""
    route = ROUTE[first : first + corners]
    return list(driven(floor_of_building(floor, identical), route, day).arrivals)


def silent(arrivals: list[Arrival]) -> list[Arrival]:
    """The arrivals without WiFi."""
    return [a for a in arrivals if not isinstance(a.measurement, WifiScan)]


def drive(
    arrivals: list[Arrival], building: BuildingMap | None = None, extends: bool = False
) -> tuple[DriveEstimate, list[Event]]:
    """The drive as estimated, in a map if one is given, and all events."""
    pipeline = Pipeline(SlamConfig(), building=building, extends=extends)
    events = [event for a in arrivals for event in pipeline.process(a.measurement)]
    result, last = pipeline.finish()
    return result, events + last


@cache
def mapped(identical: bool = False) -> BuildingMap:
    """The map of both floors."""
    return drive(ridden([part(0, 0, identical=identical), part(1, 1, identical=identical)]))[0].building
