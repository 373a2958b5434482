"""The map of a drive: what moved is redrawn, a bounded number of scans a call, until it is as if drawn from nothing."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from grids import CONFIG, FEW_BEARINGS, drawn, drive, mapped, room_scan
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.grid import grid_map
from wayfi.backend.grid.drawing import GridScan, draw_patch
from wayfi.backend.grid.grid_map import (
    CELLS_PER_KEYFRAME,
    REDRAW_KEYFRAMES,
    REDRAWN_SUBMAPS,
    SUBMAP_KEYFRAMES,
    GridMap,
)
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.grid.occupancy_grid import OccupancyGrid


def assert_same(a: OccupancyGrid, b: OccupancyGrid) -> None:
    assert (a.resolution_m, a.origin_xy_m) == (b.resolution_m, b.origin_xy_m)
    np.testing.assert_array_equal(a.evidence, b.evidence)


@pytest.fixture
def scans_drawn(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many scans each call of the drawing took."""
    counts: list[int] = []

    def counted(scans: Sequence[GridScan], *rest: object) -> object:
        counts.append(len(scans))
        return draw_patch(scans, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(grid_map, "draw_patch", counted)
    return counts


@given(st.lists(st.tuples(st.integers(0, 2), st.floats(-1.0, 1.0), st.floats(-0.3, 0.3)), max_size=4))
@settings(deadline=None, max_examples=25)
def test_whatever_moved_and_was_redrawn_before_it_settles_to_the_drawing_from_nothing(
    moves: list[tuple[int, float, float]],
) -> None:
    poses = drive(2 * SUBMAP_KEYFRAMES + 10)
    scans = [room_scan(pose, bearings=FEW_BEARINGS) for pose in poses]
    grid = mapped(scans)
    grid.redraw(poses)
    for submap, metres, radians in moves:
        members = slice(submap * SUBMAP_KEYFRAMES, (submap + 1) * SUBMAP_KEYFRAMES)
        poses[members] += [metres, -metres, radians]
        grid.redraw(poses)
    assert_same(grid.settle(poses), drawn(poses, scans))


def test_a_map_that_moved_is_redrawn_some_scans_a_call_until_it_is_as_if_drawn_from_nothing(
    scans_drawn: list[int],
) -> None:
    submaps = 3 * REDRAWN_SUBMAPS
    poses = drive(submaps * SUBMAP_KEYFRAMES)
    scans = [room_scan(pose, bearings=FEW_BEARINGS) for pose in poses]
    grid = mapped(scans)
    grid.settle(poses)
    poses += [0.4, 0.0, 0.0]
    for _ in range(submaps // REDRAWN_SUBMAPS):
        scans_drawn.clear()
        redrawn = grid.redraw(poses)
        assert sum(scans_drawn) == REDRAWN_SUBMAPS * SUBMAP_KEYFRAMES
    assert_same(redrawn, drawn(poses, scans))


def test_what_moved_furthest_is_redrawn_first_and_what_moved_less_than_a_cell_is_kept(scans_drawn: list[int]) -> None:
    poses = drive(4 * SUBMAP_KEYFRAMES)
    scans = [room_scan(pose, bearings=FEW_BEARINGS) for pose in poses]
    grid = mapped(scans)
    before = grid.settle(poses)
    scans_drawn.clear()
    assert_same(grid.redraw(poses + np.array([0.02, 0.0, 0.0])), before)
    assert scans_drawn == []
    poses[SUBMAP_KEYFRAMES] += [0.0, 0.3, 0.0]
    after = grid.redraw(poses)
    assert scans_drawn == [SUBMAP_KEYFRAMES]
    assert_same(after, drawn(poses, scans))


def test_a_long_drive_costs_a_redraw_no_more_scans_than_a_short_one(scans_drawn: list[int]) -> None:
    poses = drive(30 * SUBMAP_KEYFRAMES)
    grid, redraws = GridMap(CONFIG), []
    for number, pose in enumerate(poses):
        grid.add(room_scan(pose, bearings=FEW_BEARINGS))
        if grid.due:
            scans_drawn.clear()
            grid.redraw(poses[: number + 1])
            redraws.append(sum(scans_drawn))
    assert len(redraws) == 60
    assert max(redraws[30:]) == max(redraws[:30]) <= SUBMAP_KEYFRAMES


@pytest.mark.parametrize(("range_m", "keyframes"), [(10.0, REDRAW_KEYFRAMES), (80.0, 53)])
def test_a_redraw_is_due_after_some_scans_the_later_the_larger_the_map(range_m: float, keyframes: int) -> None:
    corners = np.array([[s * 80.0, t * 80.0] for s in (-1, 1) for t in (-1, 1)])
    grid = mapped([corners], MapConfig(max_range_m=range_m))
    side_m = 2 * range_m / math.sqrt(2) + 2 * CONFIG.margin_m
    assert keyframes == max(REDRAW_KEYFRAMES, int((side_m / CONFIG.resolution_m) ** 2 / CELLS_PER_KEYFRAME))
    grid.settle(np.zeros((1, 3)))
    for _ in range(keyframes):
        assert not grid.due
        grid.add(np.empty((0, 2), np.float32))
        grid.add(corners)
    assert grid.due


def test_without_scans_it_is_small_and_unknown_all_over() -> None:
    for poses, scans in ((np.empty((0, 3)), []), (drive(1), [np.empty((0, 2), np.float32)])):
        grid = drawn(poses, scans)
        assert 0 < grid.evidence.size < 10_000
        np.testing.assert_array_equal(grid.probability(), np.float32(0.5))


def test_an_absurd_extent_is_drawn_coarser_and_finer_again_once_it_is_corrected() -> None:
    poses = np.array([[0.0, 0.0, 0.0], [4e6, 7e6, 0.0]])
    scans = [np.array([[10.0, 0.0]])] * 2
    grid = mapped(scans, MapConfig(max_cells=100_000))
    coarse = grid.redraw(poses)
    assert coarse.evidence.size < 101_000
    assert math.log2(coarse.resolution_m / 0.05) == pytest.approx(round(math.log2(coarse.resolution_m / 0.05)))
    assert coarse.resolution_m > 1000
    assert (coarse.evidence > 0).sum() == 2
    corrected = np.zeros((2, 3))
    assert_same(grid.redraw(corrected), drawn(corrected, scans, MapConfig(max_cells=100_000)))
    assert grid.settle(corrected).resolution_m == 0.1


def test_as_many_poses_as_scans_are_asked_for() -> None:
    with pytest.raises(ValueError, match="2 poses of 1 scans"):
        drawn(np.zeros((2, 3)), [np.zeros((1, 2))])
