import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.grid_map import Floats, GridScan, MapConfig, OccupancyGrid, build_grid

CONFIG = MapConfig()
WIDTH_M, HEIGHT_M = 6.0, 5.0
BEARINGS = np.radians(np.arange(-135, 135.1, 0.25))


def room_scan(pose: Floats, noise: np.random.Generator | None = None, sensor_x_m: float = 0.0) -> GridScan:
    """What a laser `sensor_x_m` ahead of base_link sees of an empty room, its lower left corner at the origin."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = pose[0] + c * sensor_x_m, pose[1] + s * sensor_x_m
    across, up = np.cos(BEARINGS + pose[2]), np.sin(BEARINGS + pose[2])
    with np.errstate(divide="ignore"):
        ranges = np.minimum(
            np.where(across > 0, WIDTH_M - x, x) / np.abs(across),
            np.where(up > 0, HEIGHT_M - y, y) / np.abs(up),
        )
    ranges += noise.normal(0.0, 0.01, ranges.shape) if noise else 0.0
    hits = ranges[:, None] * np.c_[np.cos(BEARINGS), np.sin(BEARINGS)] + [sensor_x_m, 0.0]
    return GridScan(hits.astype(np.float32), (sensor_x_m, 0.0))


def drive(count: int = 40) -> Floats:
    angles = np.linspace(0, 4 * math.pi, count)
    radius = np.linspace(0.1, 1.5, count)
    return np.c_[3 + radius * np.cos(angles), 2.5 + radius * np.sin(angles), 3 * angles]


def probability_at(grid: OccupancyGrid, x: Floats, y: Floats) -> Floats:
    columns = np.floor((x - grid.origin_xy_m[0]) / grid.resolution_m).astype(int)
    rows = np.floor((y - grid.origin_xy_m[1]) / grid.resolution_m).astype(int)
    return grid.probability()[rows, columns].astype(float)


@pytest.mark.parametrize("sensor_x_m", [0.0, 0.3])
def test_a_room_has_walls_within_a_cell_and_is_free_inside_and_unknown_outside(sensor_x_m: float) -> None:
    noise, poses = np.random.default_rng(1), drive()
    grid = build_grid(poses, [room_scan(pose, noise, sensor_x_m) for pose in poses], CONFIG)
    cell = grid.resolution_m
    occupied = grid.probability() > CONFIG.occupied_probability
    rows, columns = np.nonzero(occupied)
    x = grid.origin_xy_m[0] + (columns + 0.5) * cell
    y = grid.origin_xy_m[1] + (rows + 0.5) * cell
    off_wall = np.minimum.reduce([np.abs(x), np.abs(x - WIDTH_M), np.abs(y), np.abs(y - HEIGHT_M)])
    assert off_wall.max() <= 1.5 * cell
    along = np.arange(0.1, HEIGHT_M - 0.1, cell)
    for wall_x in (0.0, WIDTH_M):
        near = [probability_at(grid, np.full_like(along, wall_x + k * cell), along) for k in (-0.5, 0.5)]
        assert (np.maximum(*near) > CONFIG.occupied_probability).mean() > 0.98
    inside_x, inside_y = np.meshgrid(np.arange(0.1, WIDTH_M - 0.1, cell), np.arange(0.1, HEIGHT_M - 0.1, cell))
    assert (probability_at(grid, inside_x, inside_y) < CONFIG.free_probability).mean() > 0.99
    outside = probability_at(grid, np.array([-0.5, 6.5, 3.0]), np.array([2.0, 2.0, -0.5]))
    np.testing.assert_array_equal(outside, 0.5)


@given(st.integers(-2000, 2000), st.integers(-2000, 2000))
@settings(deadline=None, max_examples=20)
def test_a_drive_moved_by_whole_cells_gives_the_same_grid_there(columns: int, rows: int) -> None:
    poses = drive(3)
    scans = [room_scan(pose) for pose in poses]
    half_cell_off = poses + np.array([0.025, 0.025, 0.0])  # walls amid cells, where rounding moves no hit
    shift = np.array([columns, rows, 0.0]) * 0.05
    grid, moved = build_grid(half_cell_off, scans, CONFIG), build_grid(half_cell_off + shift, scans, CONFIG)
    np.testing.assert_allclose(np.subtract(moved.origin_xy_m, grid.origin_xy_m), shift[:2], atol=1e-9)
    assert (moved.log_odds != grid.log_odds).mean() < 1e-3


def test_without_scans_it_is_small_and_unknown_all_over() -> None:
    for poses, scans in ((np.empty((0, 3)), []), (drive(1), [GridScan(np.empty((0, 2), np.float32))])):
        grid = build_grid(poses, scans, CONFIG)
        assert 0 < grid.log_odds.size < 10_000
        np.testing.assert_array_equal(grid.probability(), np.float32(0.5))


def test_one_ray_raises_its_end_once_and_lowers_what_it_passes_once() -> None:
    hits = np.array([[1.02, 0.02], [1.03, 0.02], [2.02, 0.02]])
    grid = build_grid(np.zeros((1, 3)), [GridScan(hits)], CONFIG)
    x = np.array([0.02, 0.52, 1.02, 1.52, 2.02, 2.07])
    odds = np.log(1 / probability_at(grid, x, np.full_like(x, 0.02)) - 1) * -1
    np.testing.assert_allclose(odds, [-0.4, -0.4, 0.85, -0.4, 0.85, 0.0], atol=1e-5)


def test_log_odds_stay_within_their_clamps() -> None:
    scans = [room_scan(drive(1)[0])] * 600
    grid = build_grid(np.repeat(drive(1), 600, axis=0), scans, CONFIG)
    assert grid.log_odds.max() == np.float32(CONFIG.max_log_odds)
    assert grid.log_odds.min() == np.float32(CONFIG.min_log_odds)


def test_a_hit_beyond_the_range_only_clears_up_to_it() -> None:
    grid = build_grid(np.zeros((1, 3)), [GridScan(np.array([[9.0, 0.02]]))], MapConfig(max_range_m=5.0))
    assert grid.log_odds.max() == 0.0
    cleared = np.flatnonzero((grid.log_odds < 0).any(axis=0)).size * grid.resolution_m
    assert cleared == pytest.approx(5.0, abs=0.051)


def test_a_ray_without_return_clears_only_when_told_to() -> None:
    scan = GridScan(np.array([[1.0, 0.0]]), no_returns=np.array([[0.0, 4.0]]))
    unknown, cleared = (build_grid(np.zeros((1, 3)), [scan], MapConfig(clear_no_return=told)) for told in (False, True))
    assert (cleared.log_odds < 0).sum() - (unknown.log_odds < 0).sum() == pytest.approx(80, abs=2)


def test_what_is_not_finite_is_passed_over() -> None:
    scan = GridScan(np.array([[1.0, 0.0], [np.nan, 1.0], [np.inf, 0.0], [0.0, -np.inf]]))
    lost = np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0]])
    grid = build_grid(lost, [scan, scan], CONFIG)
    expected = build_grid(np.zeros((1, 3)), [GridScan(np.array([[1.0, 0.0]]))], CONFIG)
    np.testing.assert_array_equal(grid.log_odds, expected.log_odds)


def test_an_absurd_extent_is_drawn_coarser_and_says_so() -> None:
    poses = np.array([[0.0, 0.0, 0.0], [4e6, 7e6, 0.0]])
    grid = build_grid(poses, [GridScan(np.array([[10.0, 0.0]]))] * 2, MapConfig(max_cells=100_000))
    assert grid.log_odds.size < 101_000
    assert grid.coarsening > 1
    assert grid.resolution_m == pytest.approx(0.05 * grid.coarsening)


def test_as_many_poses_as_scans_are_asked_for() -> None:
    with pytest.raises(ValueError, match="zip"):
        build_grid(np.zeros((2, 3)), [GridScan(np.zeros((1, 2)))], CONFIG)
