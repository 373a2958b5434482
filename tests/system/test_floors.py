"""A drive over several floors: no keyframe closes across them, and a floor that is known is told again."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from buildings.elevators import RIDE_S, on_floor, ridden
from buildings.robots import drive
from buildings.storey import ROUTE, storey
from drives import EPOCH_NS, Arrival, Simulated, simulated

from wayfi.backend.graph.health import State
from wayfi.frontends.events import ClosureJudged, Event, StateChanged, Verdict, Warned
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.merging.merging import merge
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.result import DriveEstimate
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.simulation.worlds.blueprints import World

LEAVES_S = 100


@cache
def below() -> Simulated:
    return simulated(World.OFFICE, 3.5, seed=1)


def estimated(arrivals: Sequence[Arrival]) -> tuple[DriveEstimate, list[Event]]:
    pipeline = Pipeline(SlamConfig())
    events = [event for a in arrivals for event in pipeline.process(a.measurement)]
    result, last = pipeline.finish()
    return result, events + last


def halves() -> tuple[list[Arrival], list[Arrival]]:
    """The drive below until the robot leaves, and what follows."""
    cut_ns = EPOCH_NS + LEAVES_S * SECOND_NS
    arrivals = on_floor(below().arrivals, 2)
    return [a for a in arrivals if a.at_ns < cut_ns], [a for a in arrivals if a.at_ns >= cut_ns]


def test_up_and_down_again() -> None:
    before, after = halves()
    above = on_floor(simulated(World.WAREHOUSE, 1.0, seed=1).arrivals, 4)
    result, events = estimated(ridden([before, above, after]))
    keyframes = result.building.keyframes
    floors = np.array([k.floor for k in keyframes])
    seconds = np.array([(k.stamp_ns - EPOCH_NS) / SECOND_NS for k in keyframes])
    up, down = LEAVES_S + RIDE_S, LEAVES_S + 60 + RIDE_S
    assert (floors[seconds < LEAVES_S] == 0).all()
    assert (floors[(seconds > up + 1) & (seconds < down - RIDE_S)] == 1).all()
    assert set(floors[seconds > down + RIDE_S + 1]) <= {0, 2}  # a stairwell away from the first, it is not recognised
    closed = [e for e in events if isinstance(e, ClosureJudged) and e.verdict is Verdict.ACCEPTED]
    assert all(floors[e.keyframe_a] == floors[e.keyframe_b] for e in closed)
    assert next(e.text.split(":")[0] for e in events if isinstance(e, Warned)) == "floor 1"


def test_an_elevator_that_comes_back_to_the_same_floor_is_told_as_the_same() -> None:
    result, events = estimated(ridden(halves()))
    assert {k.floor for k in result.building.keyframes} == {0}
    assert not [e for e in events if isinstance(e, Warned)]
    assert {e.state for e in events if isinstance(e, StateChanged)} <= {State.TRACKING, State.UNCERTAIN}


@pytest.mark.parametrize("world", [World.OFFICE, World.WAREHOUSE])
def test_a_flat_building_notices_nothing(world: World) -> None:
    result, events = estimated(simulated(world, 2.0, seed=3).arrivals)
    assert {k.floor for k in result.building.keyframes} == {0}
    assert not [e for e in events if isinstance(e, Warned)]


@pytest.mark.slow
def test_two_drives_over_two_floors_are_merged_floor_by_floor() -> None:
    """Both floors look alike; the elevator puts the upper one where it is to some centimetres."""

    def mapped(day: int) -> BuildingMap:
        floors = (drive(storey(), ROUTE, day=day), drive(storey(), ROUTE, day=day + 10))
        parts = [on_floor(driven.arrivals, number) for driven, number in zip(floors, (2, 4), strict=True)]
        return estimated(ridden(parts))[0].building

    first, second = mapped(1), mapped(2)
    merged = merge(first, second, SlamConfig())
    assert merged.floors == {0: 0, 1: 1}
    assert np.hypot(merged.T_a_b.x, merged.T_a_b.y) < 0.1
    assert abs(merged.T_a_b.theta) < 0.02
    joined = merged.building
    ties = [c.judged for c in joined.closures[len(first.closures) + len(second.closures) :]]
    floors_of_ties = {(joined.keyframes[t.keyframe_a].floor, joined.keyframes[t.keyframe_b].floor) for t in ties}
    assert floors_of_ties == {(0, 0), (1, 1)}
