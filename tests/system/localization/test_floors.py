"""A building of two floors: the robot is found on the right one, or it is told that nothing says which one it is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from buildings.elevators import RIDE_S, ridden
from buildings.two_floors import drive, mapped, part, silent
from drives import Arrival

from wayfi.backend.graph.health import FailureCategory, State
from wayfi.frontends.events import Event, FloorChanged, GridRedrawn, StateChanged, Warned
from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.saving import save_map

FIRST, LAST = 2, 4  # corner and corners of a drive through the rooms


def claimed(events: list[Event]) -> list[int]:
    """The floors that were claimed, in their order."""
    return [e.floor for e in events if isinstance(e, FloorChanged) and e.floor is not None]


def reasons(events: list[Event]) -> str:
    return "\n".join(e.reason for e in events if isinstance(e, StateChanged))


@pytest.mark.parametrize("identical", [False, True])
def test_a_map_of_two_floors_has_a_grid_for_each(identical: bool, tmp_path: Path) -> None:
    building = mapped(identical)
    assert building.floors == sorted(building.grids) == [0, 1]
    save_map(tmp_path, building)
    assert {"map.yaml", "map_floor1.yaml", "grid_floor1.parquet"} <= {path.name for path in tmp_path.iterdir()}
    assert "image: map_floor1.pgm" in (tmp_path / "map_floor1.yaml").read_text()
    loaded = load_map(tmp_path)
    assert not loaded.warnings
    for floor, grid in building.grids.items():
        np.testing.assert_array_equal(loaded.building.grids[floor].evidence, grid.evidence)


def test_a_map_that_becomes_flat_leaves_no_grid_of_a_floor_behind(tmp_path: Path) -> None:
    building = mapped()
    name = save_map(tmp_path, building)
    flat = replace(building, keyframes=[replace(k, floor=0) for k in building.keyframes], grids={0: building.grid})
    save_map(tmp_path, flat, former=name)
    assert not list(tmp_path.glob("*floor*"))
    assert not load_map(tmp_path).warnings


@pytest.mark.parametrize("identical", [False, True])
@pytest.mark.parametrize("floor", [0, 1])
def test_wifi_tells_the_floor(floor: int, identical: bool) -> None:
    result, events = drive(part(floor, 10 + floor, FIRST, LAST, identical), mapped(identical))
    assert claimed(events) == [floor]
    assert set(result.floors) == {floor}
    assert [e.floor for e in events if isinstance(e, GridRedrawn)] == ([0, 1] if floor else [0, 0])


def test_two_identical_floors_without_wifi_are_never_claimed() -> None:
    result, events = drive(silent(part(1, 12, 1, 6, identical=True)), mapped(identical=True))
    assert not claimed(events)
    assert len(result.stamps_ns) == 0
    assert "floors 0 and 1 look alike here, and no WiFi tells which one it is" in reasons(events)


def test_floors_that_differ_are_told_by_the_laser_alone() -> None:
    _, events = drive(silent(part(1, 13, 1, 6)), mapped())
    assert claimed(events) == [1]


@pytest.mark.parametrize("identical", [False, True])
def test_in_an_elevator_nothing_is_claimed_and_then_the_other_floor(identical: bool) -> None:
    """Three rides: in one of seven WiFi names another place of the floor for longer, a few metres on."""
    found_s = [found_after_a_ride(seed, identical) for seed in (20, 22, 24)]
    assert min(found_s) > 0.0
    assert np.median(found_s) < 10.0


def found_after_a_ride(seed: int, identical: bool) -> float:
    """The seconds from the end of a ride until the floor where it ends is claimed; nothing else is, meanwhile."""
    before, after = part(0, seed, 5, 6, identical), part(1, seed + 1, 0, 4, identical)
    _, events = drive(ridden([before, after]), mapped(identical))
    assert claimed(events) == [0, 1]
    left = next(e for e in events if isinstance(e, StateChanged) and "elevator" in e.reason)
    assert left.state is State.RELOCALISING
    assert left.failure_category is FailureCategory.FLOOR_UNKNOWN
    again = next(e for e in events if isinstance(e, FloorChanged) and e.floor == 1)
    return (again.stamp_ns - before[-1].at_ns) / SECOND_NS - RIDE_S


def test_a_robot_that_starts_in_an_elevator_is_found_on_the_floor_where_it_comes_out() -> None:
    _, events = drive(started_in_elevator(), mapped())
    assert claimed(events) == [1]
    assert "the robot may be in an elevator: its floor is sought once it has left" in reasons(events)


def test_a_map_that_begins_in_an_elevator_has_the_floor_where_it_comes_out() -> None:
    result, events = drive(started_in_elevator())
    assert result.building.floors == [0]
    told = [e.text for e in events if isinstance(e, Warned)]
    assert "floor 0 is where the robot left the elevator that it was switched on in" in told


@pytest.mark.parametrize("floor", [0, 1])
def test_a_drive_that_goes_on_changes_its_floor_alone(floor: int) -> None:
    before = mapped()
    after = drive(part(floor, 30 + floor, 1, 8), before, extends=True)[0].building
    assert after.floors == [0, 1]
    other = 1 - floor
    kept, known = ([k for k in b.keyframes if k.floor == other] for b in (after, before))
    assert [k.stamp_ns for k in kept] == [k.stamp_ns for k in known]
    for one, its in zip(kept, known, strict=True):
        np.testing.assert_array_equal(one.hits, its.hits)  # nothing that is seen through from the other floor is gone
    heard = [[b.keyframes[f.keyframe].floor for f in b.fingerprints].count(other) for b in (before, after)]
    assert heard[0] == heard[1]
    assert len(after.keyframes) < 1.3 * len(before.keyframes)


def started_in_elevator() -> list[Arrival]:
    """The robot is switched on in the elevator of floor 0, and leaves it on floor 1."""
    below, above = part(0, 40, 0, 2), part(1, 41, 2, 4)
    static = below[0]
    joined = ridden([below, above])
    return [static, *(a for a in joined if a.at_ns > below[-1].at_ns)]
