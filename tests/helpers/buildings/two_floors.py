"""A building of two floors that are joined by an elevator: a map of both, and drives of another day on one."""

from functools import cache

from buildings.elevators import on_floor, ridden
from drives import EPOCH_NS, Arrival, simulated

from wayfi.frontends.events import Event
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.measurements import SECOND_NS, WifiScan
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.result import DriveEstimate
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.simulation.worlds.blueprints import World


@cache
def day(seed: int, world: World = World.OFFICE, minutes: float = 3.0) -> tuple[Arrival, ...]:
    """A drive through one floor; the same building for every seed, other noise."""
    return tuple(simulated(world, minutes, seed=seed).arrivals)


def part(arrivals: tuple[Arrival, ...], floor: int, since_s: float = 0.0, until_s: float = 1e9) -> list[Arrival]:
    """The arrivals of some seconds of a drive, with the access points of a floor; what has no time of its own stays."""
    first, last = EPOCH_NS + since_s * SECOND_NS, EPOCH_NS + until_s * SECOND_NS
    return [a for a in on_floor(arrivals, 2 + 2 * floor) if a.at_ns < EPOCH_NS + SECOND_NS or first <= a.at_ns < last]


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
def mapped(*floors: World) -> BuildingMap:
    """The map of these floors, one ride after another."""
    parts = [part(day(1, world), number) for number, world in enumerate(floors)]
    return drive(ridden(parts))[0].building
