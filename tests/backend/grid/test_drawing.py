"""Rays of scans in cells: walls a cell thick, free space up to them, and nothing beyond what beams have passed."""

import numpy as np
import pytest
from grids import BEARINGS, CONFIG, HEIGHT_M, WIDTH_M, cells, drawn, drive, probability_at, room_scan
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.grid.drawing import GridScan, draw_patch
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.grid.sensor_model import HIT


@pytest.mark.parametrize("sensor_x_m", [0.0, 0.3])
def test_a_room_has_walls_within_a_cell_and_is_free_inside_and_unknown_outside(sensor_x_m: float) -> None:
    noise, poses = np.random.default_rng(1), drive()
    grid = drawn(poses, [room_scan(pose, noise, sensor_x_m) for pose in poses], CONFIG, sensor_x_m)
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
    grid, moved = drawn(half_cell_off, scans), drawn(half_cell_off + shift, scans)
    np.testing.assert_allclose(np.subtract(moved.origin_xy_m, grid.origin_xy_m), shift[:2], atol=1e-9)
    assert (moved.evidence != grid.evidence).mean() < 1e-3


@given(st.randoms(use_true_random=False))
@settings(deadline=None, max_examples=10)
def test_the_scans_of_a_patch_may_come_in_any_order(random: object) -> None:
    poses = drive(8)
    scans = [GridScan(room_scan(pose, np.random.default_rng(k))) for k, pose in enumerate(poses)]
    order = list(range(len(scans)))
    random.shuffle(order)  # type: ignore[attr-defined]
    patch = draw_patch(scans, poses, 0.05, CONFIG)
    shuffled = draw_patch([scans[k] for k in order], poses[order], 0.05, CONFIG)
    assert shuffled.window == patch.window
    np.testing.assert_array_equal(shuffled.evidence, patch.evidence)


def test_a_wall_seen_twice_is_occupied_and_one_ray_that_passes_does_not_erase_it() -> None:
    wall, beyond = np.array([[2.02, 0.02]]), np.array([[4.02, 0.02]])
    place = np.array([2.02]), np.array([0.02])
    assert probability_at(drawn(np.zeros((2, 3)), [wall, wall]), *place)[0] > CONFIG.occupied_probability
    assert probability_at(drawn(np.zeros((3, 3)), [wall, wall, beyond]), *place)[0] > CONFIG.occupied_probability


def test_noisy_ranges_do_not_thicken_a_wall() -> None:
    noise, poses = np.random.default_rng(3), np.tile([3.0, 2.5, 0.0], (60, 1))
    directions = np.c_[np.cos(BEARINGS), np.sin(BEARINGS)]
    scans = [room_scan(pose) + directions * noise.normal(0.0, 0.025, (len(BEARINGS), 1)) for pose in poses]
    grid = drawn(poses, scans)
    along = np.arange(0.5, 4.5, 0.05)
    across = np.arange(WIDTH_M - 0.3, WIDTH_M + 0.3, 0.05)
    occupied = probability_at(grid, *np.meshgrid(across, along)) > CONFIG.occupied_probability
    hit = np.concatenate([scan[:, 0][np.abs(scan[:, 1]) < 1.5] for scan in scans]) + 3.0
    assert np.ptp(hit[hit > 5.5]) > 0.15  # hits in four cells and more
    assert (occupied.sum(axis=1) >= 1).all()
    assert occupied.sum(axis=1).mean() < 2.1


def test_most_rays_start_far_out_and_hardly_a_cell_is_missed() -> None:
    noise, pose = np.random.default_rng(4), drive(1)
    scan = (
        room_scan(pose[0]) * noise.choice([0.3, 1.0], (len(BEARINGS) // 40 + 1, 1)).repeat(40, axis=0)[: len(BEARINGS)]
    )
    patch = draw_patch([GridScan(scan)], pose, 0.02, CONFIG)
    passed = np.zeros(patch.evidence.shape, bool)
    for ray in scan:  # each alone, from the sensor on
        alone = draw_patch([GridScan(ray[None])], pose, 0.02, CONFIG)
        row, column = alone.window.row - patch.window.row, alone.window.column - patch.window.column
        passed[row : row + alone.window.shape[0], column : column + alone.window.shape[1]] |= alone.evidence < 0
    passed &= patch.evidence <= 0
    drawn_passed = patch.evidence < 0
    assert drawn_passed.sum() > 0.97 * passed.sum()
    assert (passed & drawn_passed).sum() > 0.94 * passed.sum()
    missed = passed & ~drawn_passed
    around = np.lib.stride_tricks.sliding_window_view(np.pad(drawn_passed, 1), (3, 3)).sum(axis=(2, 3))
    assert around[missed].min() >= 2  # single cells, not sectors


def test_a_corridor_too_long_for_the_laser_is_free_ahead() -> None:
    bearings = np.radians(np.arange(-89.75, 90, 0.5))
    ranges = 1.0 / np.abs(np.sin(bearings))
    corridor = (ranges[:, None] * np.c_[np.cos(bearings), np.sin(bearings)])[ranges < 10.0]
    x = np.arange(0.0, 9.5, 0.05)
    ahead = probability_at(drawn(np.zeros((4, 3)), [corridor] * 4), x, np.full_like(x, 0.01))
    assert (ahead < CONFIG.free_probability).mean() > 0.98


def test_beyond_glass_and_where_a_wide_sector_is_silent_nothing_is_free() -> None:
    y = np.arange(-5.0, 5.0, 0.04)
    frames = np.c_[np.full_like(y, 3.0), y]
    glass = np.abs(frames[:, 1]) < 0.4
    grid = drawn(np.zeros((4, 3)), [frames[~glass]] * 4)
    assert probability_at(grid, np.array([2.8]), np.array([0.0]))[0] < CONFIG.free_probability
    pane = probability_at(grid, np.full(7, 3.01), np.arange(-0.3, 0.31, 0.1))
    np.testing.assert_array_equal(pane, 0.5)
    wide = np.abs(frames[:, 1]) < 0.8
    grid = drawn(np.zeros((4, 3)), [frames[~wide]] * 4)
    assert probability_at(grid, np.array([1.5]), np.array([0.0]))[0] == 0.5


def test_one_scan_raises_its_ends_once_and_lowers_what_it_passes_once() -> None:
    hits = np.array([[1.02, 0.02], [1.03, 0.02], [2.02, 0.02]])
    grid = drawn(np.zeros((1, 3)), [hits])
    x = np.array([0.02, 0.52, 1.02, 1.52, 2.02, 2.07])
    assert grid.evidence[cells(grid, x, np.full_like(x, 0.02))].tolist() == [-1, -1, HIT, -1, HIT, 0]


def test_a_hit_beyond_the_range_only_clears_up_to_it() -> None:
    grid = drawn(np.zeros((1, 3)), [np.array([[9.0, 0.02]])], MapConfig(max_range_m=5.0))
    assert grid.evidence.max() == 0
    cleared = np.flatnonzero((grid.evidence < 0).any(axis=0)).size * grid.resolution_m
    assert cleared == pytest.approx(5.0, abs=0.051)


def test_what_is_not_finite_is_passed_over() -> None:
    scan = np.array([[1.0, 0.0], [np.nan, 1.0], [np.inf, 0.0], [0.0, -np.inf], [0.0, 0.0]])
    lost = np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0]])
    grid = drawn(lost, [scan, scan])
    np.testing.assert_array_equal(grid.evidence, drawn(np.zeros((1, 3)), [np.array([[1.0, 0.0]])]).evidence)
