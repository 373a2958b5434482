import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.grid import grid_map
from wayfi.backend.grid.drawing import HIT, MOST_SCANS, Floats, GridScan, Points, draw_patch
from wayfi.backend.grid.grid_map import (
    CELLS_A_KEYFRAME,
    REDRAW_KEYFRAMES,
    REDRAWN_AT_ONCE,
    SUBMAP_KEYFRAMES,
    GridMap,
    MapConfig,
)
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.grid.patch import FREE_MOST, OCCUPIED_MOST, CellWindow

CONFIG = MapConfig()
WIDTH_M, HEIGHT_M = 6.0, 5.0
BEARINGS = np.radians(np.arange(-135, 135.1, 0.25))
FEW_BEARINGS = BEARINGS[::20]


def room_scan(
    pose: Floats, noise: np.random.Generator | None = None, sensor_x_m: float = 0.0, bearings: Floats = BEARINGS
) -> Points:
    """What a laser `sensor_x_m` ahead of base_link sees of an empty room, its lower left corner at the origin."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = pose[0] + c * sensor_x_m, pose[1] + s * sensor_x_m
    across, up = np.cos(bearings + pose[2]), np.sin(bearings + pose[2])
    with np.errstate(divide="ignore"):
        ranges = np.minimum(
            np.where(across > 0, WIDTH_M - x, x) / np.abs(across),
            np.where(up > 0, HEIGHT_M - y, y) / np.abs(up),
        )
    ranges += noise.normal(0.0, 0.01, ranges.shape) if noise else 0.0
    hits = ranges[:, None] * np.c_[np.cos(bearings), np.sin(bearings)] + [sensor_x_m, 0.0]
    return hits.astype(np.float32)


def behind(hits: Points, pose: Floats, disc_xy_m: tuple[float, float], radius_m: float) -> Points:
    """The `hits` seen from base_link at `pose`, cut where a disc, round as a person, stands before them."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    towards = np.array([[c, s], [-s, c]]) @ (np.array(disc_xy_m) - pose[:2])
    ranges = np.hypot(hits[:, 0], hits[:, 1])
    directions = hits / ranges[:, None]
    along = directions @ towards
    inside = radius_m**2 - (towards @ towards - along**2)
    entered = along - np.sqrt(np.maximum(inside, 0.0))
    cut = (inside > 0) & (along > 0) & (entered < ranges)
    return np.where(cut[:, None], directions * entered[:, None], hits).astype(np.float32)


def drive(count: int = 40) -> Floats:
    angles = np.linspace(0, 4 * math.pi, count)
    radius = np.linspace(0.1, 1.5, count)
    return np.c_[3 + radius * np.cos(angles), 2.5 + radius * np.sin(angles), 3 * angles]


def mapped(scans: Sequence[Points], config: MapConfig = CONFIG, sensor_x_m: float = 0.0) -> GridMap:
    grid = GridMap(config)
    for hits in scans:
        grid.add(hits, (sensor_x_m, 0.0))
    return grid


def drawn(poses: Floats, scans: Sequence[Points], config: MapConfig = CONFIG, sensor_x_m: float = 0.0) -> OccupancyGrid:
    """The grid from nothing."""
    return mapped(scans, config, sensor_x_m).settle(poses)


def assert_same(a: OccupancyGrid, b: OccupancyGrid) -> None:
    assert (a.resolution_m, a.origin_xy_m) == (b.resolution_m, b.origin_xy_m)
    np.testing.assert_array_equal(a.evidence, b.evidence)


def cells(grid: OccupancyGrid, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    columns = np.floor((x - grid.origin_xy_m[0]) / grid.resolution_m).astype(int)
    rows = np.floor((y - grid.origin_xy_m[1]) / grid.resolution_m).astype(int)
    return rows, columns


def probability_at(grid: OccupancyGrid, x: Floats, y: Floats) -> Floats:
    return grid.probability()[cells(grid, x, y)].astype(float)


@pytest.fixture
def scans_drawn(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many scans each call of the drawing took."""
    counts: list[int] = []

    def counted(scans: Sequence[GridScan], *rest: object) -> object:
        counts.append(len(scans))
        return draw_patch(scans, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(grid_map, "draw_patch", counted)
    return counts


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
    patch = draw_patch(scans, poses, 0.05, 30.0)
    shuffled = draw_patch([scans[k] for k in order], poses[order], 0.05, 30.0)
    assert shuffled.window == patch.window
    np.testing.assert_array_equal(shuffled.evidence, patch.evidence)


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
    submaps = 3 * REDRAWN_AT_ONCE
    poses = drive(submaps * SUBMAP_KEYFRAMES)
    scans = [room_scan(pose, bearings=FEW_BEARINGS) for pose in poses]
    grid = mapped(scans)
    grid.settle(poses)
    poses += [0.4, 0.0, 0.0]
    for _ in range(submaps // REDRAWN_AT_ONCE):
        scans_drawn.clear()
        redrawn = grid.redraw(poses)
        assert sum(scans_drawn) == REDRAWN_AT_ONCE * SUBMAP_KEYFRAMES
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
    assert keyframes == max(REDRAW_KEYFRAMES, int((side_m / CONFIG.resolution_m) ** 2 / CELLS_A_KEYFRAME))
    grid.settle(np.zeros((1, 3)))
    for _ in range(keyframes):
        assert not grid.due
        grid.add(np.empty((0, 2), np.float32))
        grid.add(corners)
    assert grid.due


def test_a_person_who_walks_by_leaves_free_space_and_the_walls_behind() -> None:
    poses = np.c_[np.linspace(1.0, 2.0, 60), np.full(60, 1.0), np.full(60, 0.5)]
    person = [(1.5 + 0.05 * k, 3.5) for k in range(60)]
    scans = [behind(room_scan(pose), pose, at, 0.25) for pose, at in zip(poses, person, strict=True)]
    grid = drawn(poses, scans)
    x, y = (a.ravel() for a in np.meshgrid(np.arange(1.5, 4.5, 0.05), np.arange(3.2, 3.8, 0.05)))
    walked = probability_at(grid, x, y)
    assert walked.max() < CONFIG.occupied_probability
    assert (walked < CONFIG.free_probability).mean() > 0.95
    alone = drawn(poses, [room_scan(pose) for pose in poses])
    known = alone.evidence != 0
    sure = np.sign(grid.evidence[known]) == np.sign(alone.evidence[known])
    assert sure.mean() > 0.98


@pytest.mark.parametrize("there_first", [True, False])
def test_what_was_seen_last_wins(there_first: bool) -> None:
    poses = np.c_[np.tile(np.linspace(1.0, 2.0, 60), 2), np.full(120, 1.0), np.full(120, 0.5)]
    seen = [there_first] * 60 + [not there_first] * 60
    scans = [
        behind(room_scan(pose), pose, (4.0, 3.0), 0.4) if there else room_scan(pose)
        for pose, there in zip(poses, seen, strict=True)
    ]
    angles = np.radians(np.arange(180, 260, 2))  # its near side
    grid = drawn(poses, scans)
    side = [probability_at(grid, 4.0 + r * np.cos(angles), 3.0 + r * np.sin(angles)) for r in (0.38, 0.41, 0.44)]
    if there_first:
        assert np.max(side) < CONFIG.free_probability
    else:
        assert (np.max(side, axis=0) > CONFIG.occupied_probability).mean() > 0.95


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
    patch = draw_patch([GridScan(scan)], pose, 0.02, 30.0)
    passed = np.zeros(patch.evidence.shape, bool)
    for ray in scan:  # each alone, from the sensor on
        alone = draw_patch([GridScan(ray[None])], pose, 0.02, 30.0)
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


def test_without_scans_it_is_small_and_unknown_all_over() -> None:
    for poses, scans in ((np.empty((0, 3)), []), (drive(1), [np.empty((0, 2), np.float32)])):
        grid = drawn(poses, scans)
        assert 0 < grid.evidence.size < 10_000
        np.testing.assert_array_equal(grid.probability(), np.float32(0.5))


def test_one_scan_raises_its_ends_once_and_lowers_what_it_passes_once() -> None:
    hits = np.array([[1.02, 0.02], [1.03, 0.02], [2.02, 0.02]])
    grid = drawn(np.zeros((1, 3)), [hits])
    x = np.array([0.02, 0.52, 1.02, 1.52, 2.02, 2.07])
    assert grid.evidence[cells(grid, x, np.full_like(x, 0.02))].tolist() == [-1, -1, HIT, -1, HIT, 0]


def test_evidence_stays_within_its_bounds_and_its_type() -> None:
    scans = [room_scan(drive(1)[0])] * 600
    grid = drawn(np.repeat(drive(1), 600, axis=0), scans)
    assert (grid.evidence.min(), grid.evidence.max()) == (FREE_MOST, OCCUPIED_MOST)
    assert SUBMAP_KEYFRAMES <= MOST_SCANS
    patch = draw_patch([GridScan(scans[0])] * MOST_SCANS, np.repeat(drive(1), MOST_SCANS, axis=0), 0.05, 30.0)
    assert patch.evidence.max() == MOST_SCANS * HIT


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


def test_windows() -> None:
    window = CellWindow(0, 0, 4, 6)
    assert window.overlap(CellWindow(2, -3, 9, 2)) == CellWindow(2, 0, 4, 2)
    assert window.overlap(CellWindow(5, 0, 9, 2)).shape == (0, 2)
    assert CellWindow(1, 1, 4, 6).within(window)
    assert not CellWindow(1, 1, 5, 6).within(window)
    assert CellWindow(9, 9, 9, 9).within(window)
