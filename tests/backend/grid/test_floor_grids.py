"""The grids of several floors: each is as if there were no other."""

import numpy as np
from grids import CONFIG, mapped

from wayfi.backend.grid.floor_grids import FloorGrids
from wayfi.backend.grid.occupancy_grid import OccupancyGrid

RNG = np.random.default_rng(3)
SCANS = [RNG.uniform(-3.0, 3.0, (40, 2)).astype(np.float32) for _ in range(50)]
POSES = np.column_stack([np.linspace(0.0, 9.0, 50), np.zeros(50), np.zeros(50)])
NOTHING = np.empty((0, 2), np.float32)


def assert_same(one: OccupancyGrid, other: OccupancyGrid) -> None:
    np.testing.assert_array_equal(one.evidence, other.evidence)
    assert one.origin_xy_m == other.origin_xy_m


def alone(floors: list[int], floor: int) -> OccupancyGrid:
    """The grid of a floor without the scans of all others."""
    return mapped([s if at == floor else NOTHING for s, at in zip(SCANS, floors, strict=True)]).settle(POSES)


def added(floors: list[int]) -> FloorGrids:
    grids = FloorGrids(CONFIG)
    for scan, floor in zip(SCANS, floors, strict=True):
        grids.add(floor, scan)
    return grids


def test_each_floor_is_drawn_alone() -> None:
    floors = [0] * 20 + [1] * 20 + [0] * 10
    settled = added(floors).settle(POSES, np.array(floors))
    assert sorted(settled) == [0, 1]
    for floor, grid in settled.items():
        assert_same(grid, alone(floors, floor))


def test_keyframes_that_are_on_another_floor_are_taken_from_the_first() -> None:
    grids, floors = added([0] * 50), [0] * 33 + [2] * 17
    grids.redraw(POSES, np.zeros(50, np.int64))
    assert_same(grids.redraw(POSES, np.array(floors)), alone(floors, 2))
    assert_same(grids.drawn()[0], alone(floors, 0))
    assert all(mine is scan for mine, scan in zip(grids.hits(), SCANS, strict=True))


def test_a_flat_building_is_one_grid() -> None:
    grids, one = added([0] * 50), mapped(SCANS)
    assert grids.due == one.due
    assert_same(grids.redraw(POSES, np.zeros(50, np.int64)), one.redraw(POSES))
    assert list(grids.drawn()) == [0]


def test_floor_0_is_there_though_nothing_was_seen_of_it() -> None:
    settled = added([3] * 50).settle(POSES, np.full(50, 3))
    assert not settled[0].evidence.any()
    assert_same(settled[3], alone([3] * 50, 3))
