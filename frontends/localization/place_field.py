"""What the search of the whole map compares with: its walls as a likelihood field, and where a robot can be.

The field is kept at growing block sizes, each cell with the greatest value of the block, so that the score of a block
of poses is never below that of a pose in it (Hess et al., Cartographer, ICRA 2016).
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.localization.search_config import MapSearchConfig
from wayfi.frontends.maps.building_map import BuildingMap

LEVELS = 4  # the largest block has 2 ** (LEVELS - 1) cells a side, 1.6 m: larger ones have a wall nearly everywhere
FULL = 255  # the likelihood of a point on a wall
PARTS = 4  # of a cell's side: the finest cells are of 5 cm, as those of the grid
MAX_CELLS = 4_000_000  # 400 x 400 m at 20 cm: bounds the memory to 100 MB, however far a false pose lies
MAX_SIDE = 60_000  # cells along an axis: rows and columns of 16 bits
SLICE = 200  # scans placed at once
FREE = -2  # evidence of a cell that more than one ray has passed
BAND = 400  # rows of walls, 20 m, that are blurred at once
NEAR_CELLS = 1  # of the grid, from a point: its wall may be drawn in the next cell


class PlaceField(NamedTuple):
    """The likelihood of a point in each cell of side `cell_m`, and the cells where a robot can be; rows run along x.

    `pooled[k][r, c]` uint8 is the greatest likelihood of the 2**k x 2**k cells from (r - 2**k + 1, c - 2**k + 1) on.
    `open[k][i, j]` tells whether a robot can be in any of the 2**k x 2**k cells from (i * 2**k, j * 2**k) on.
    `fine` has PARTS x PARTS cells for each cell, and a sharper likelihood. The lower corner of cell (0, 0) is `origin`
    (2,) m in `map`.
    """

    pooled: tuple[NDArray[np.uint8], ...]
    open: tuple[NDArray[np.bool_], ...]
    fine: NDArray[np.uint8]
    origin: Floats
    cell_m: float


def building_steps(building: BuildingMap, config: MapSearchConfig, floor: int = 0) -> Iterator[PlaceField | None]:
    """Build the field of a floor of a map step by step, each step a few milliseconds; the last one yields it."""
    grid = building.grid_of(floor)
    finite = np.asarray(np.isfinite(building.poses).all(axis=1))
    numbers = [
        k
        for k, keyframe in enumerate(building.keyframes)
        if keyframe.scan is not None and keyframe.floor == floor and finite[k]
    ]
    places = building.poses[numbers, :2]
    origin, shape, cell_m = _extent(places, grid, config.cell_m)
    walls = np.zeros((shape[0] * PARTS, shape[1] * PARTS), np.bool_)
    for start in range(0, len(numbers), SLICE):
        points = _placed(building, numbers[start : start + SLICE])
        _mark(walls, _still_there(points, grid), origin, cell_m / PARTS)
        yield None
    fine, coarse = np.zeros(walls.shape, np.uint8), np.zeros(shape, np.uint8)
    for start in range(0, len(walls), BAND):
        _blur(walls, start, start + BAND, fine, config.fine_blur_m * PARTS / cell_m)
        yield None
        _blur(walls, start, start + BAND, coarse, config.blur_m / cell_m)
        yield None
    pooled = [coarse]
    for k in range(1, LEVELS):
        pooled.append(_pooled(pooled[-1], 2 ** (k - 1)))
        yield None
    open_levels = [_open_cells(grid, places, origin, shape, cell_m)]
    for _ in range(1, LEVELS):
        open_levels.append(_halved(open_levels[-1]))
    yield PlaceField(tuple(pooled), tuple(open_levels), fine, origin, cell_m)


def _placed(building: BuildingMap, keyframes: list[int]) -> Floats:
    """(n, 2) m, the points of keyframes' scans in `map`."""
    scans = [building.keyframes[k].scan for k in keyframes]
    placed = zip(building.poses[keyframes].tolist(), scans, strict=True)
    return np.concatenate([Pose2.of(pose).transform(scan.points) for pose, scan in placed if scan])


def _extent(places: Floats, grid: OccupancyGrid, cell_m: float) -> tuple[Floats, tuple[int, int], float]:
    """The lower corner of the field (m), its cells along x and y, and their side: `cell_m`, more if there are too many.

    It holds the grid, and the keyframes' places (n, 2) m.
    """
    rows, columns = grid.evidence.shape
    low = np.array(grid.origin_xy_m)
    corners = np.vstack([low, low + grid.resolution_m * np.array([columns, rows]), places])
    extent = corners.max(axis=0) - corners.min(axis=0)
    cell_m = max(cell_m, math.sqrt(extent.prod() / MAX_CELLS), extent.max() / MAX_SIDE)
    x, y = np.ceil(extent / cell_m).astype(int) + 2
    return corners.min(axis=0) - 0.5 * cell_m, (int(x), int(y)), cell_m


def _still_there(points: Floats, grid: OccupancyGrid) -> Floats:
    """The points (n, 2) m that no later scan has looked through: the grid is not free around them."""
    columns, rows = np.floor((points - grid.origin_xy_m) / grid.resolution_m).astype(np.int64).T
    return points[_is_near_wall(grid.evidence, rows, columns)]


@njit(cache=True)
def _is_near_wall(evidence: NDArray[np.int8], rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(n,) whether evidence of at least 0 is within NEAR_CELLS of each cell, or the cell is beyond the grid."""
    kept = np.zeros(rows.shape[0], np.bool_)
    for i in range(rows.shape[0]):
        r, c = rows[i], columns[i]
        for near_r in range(r - NEAR_CELLS, r + NEAR_CELLS + 1):
            for near_c in range(c - NEAR_CELLS, c + NEAR_CELLS + 1):
                inside = 0 <= near_r < evidence.shape[0] and 0 <= near_c < evidence.shape[1]
                if not inside or evidence[near_r, near_c] >= 0:
                    kept[i] = True
    return kept


@njit(cache=True)
def _mark(walls: NDArray[np.bool_], points: Floats, origin: Floats, cell_m: float) -> None:
    for i in range(points.shape[0]):
        r, c = np.floor((points[i, 0] - origin[0]) / cell_m), np.floor((points[i, 1] - origin[1]) / cell_m)
        if 0 <= r < walls.shape[0] and 0 <= c < walls.shape[1]:
            walls[int(r), int(c)] = True


@njit(cache=True)
def _blur(walls: NDArray[np.bool_], first: int, end: int, field: NDArray[np.uint8], sigma_cells: float) -> None:
    """Draw the walls of rows from `first` until `end` into the field: the Gaussian of a cell's distance from them.

    It ends at two sigmas. A cell of the field has one or more of the cells of `walls` along a side.
    """
    rows, columns = field.shape
    parts, reach = walls.shape[0] // rows, math.ceil(2 * sigma_cells)
    for i in range(first, min(end, walls.shape[0])):
        for j in range(walls.shape[1]):
            if not walls[i, j]:
                continue
            r0, c0 = i // parts, j // parts
            for r in range(max(r0 - reach, 0), min(r0 + reach + 1, rows)):
                for c in range(max(c0 - reach, 0), min(c0 + reach + 1, columns)):
                    dr, dc = r + 0.5 - (i + 0.5) / parts, c + 0.5 - (j + 0.5) / parts
                    d2 = (dr * dr + dc * dc) / (sigma_cells * sigma_cells)
                    if d2 <= 4.0:
                        field[r, c] = max(field[r, c], np.uint8(FULL * np.exp(-0.5 * d2)))


@njit(cache=True)
def _pooled(block: NDArray[np.uint8], side: int) -> NDArray[np.uint8]:
    """The field of blocks of twice the `side`, each ending at its own cell, of the field of blocks of one `side`."""
    rows, columns = block.shape
    pooled = np.zeros((rows + side, columns + side), np.uint8)
    for r in range(rows):
        for c in range(columns):
            value = block[r, c]
            pooled[r, c] = max(pooled[r, c], value)
            pooled[r + side, c] = max(pooled[r + side, c], value)
            pooled[r, c + side] = max(pooled[r, c + side], value)
            pooled[r + side, c + side] = max(pooled[r + side, c + side], value)
    return pooled


def _open_cells(
    grid: OccupancyGrid, places: Floats, origin: Floats, shape: tuple[int, int], cell_m: float
) -> NDArray[np.bool_]:
    """(rows, columns) where a robot can be: where the grid has a free cell, and where one was, `places` (n, 2) m."""
    cells = np.zeros(shape, np.bool_)
    corner = (np.array(grid.origin_xy_m) + 0.5 * grid.resolution_m - origin) / cell_m
    _mark_free(cells, grid.evidence, corner, grid.resolution_m / cell_m)
    _mark(cells, places, origin, cell_m)
    return cells


@njit(cache=True)
def _mark_free(cells: NDArray[np.bool_], evidence: NDArray[np.int8], corner: Floats, step: float) -> None:
    """Set the cells with the middle of a free cell of the grid, whose first one is at `corner`, in cells."""
    for r in range(evidence.shape[0]):
        for c in range(evidence.shape[1]):
            if evidence[r, c] <= FREE:
                cells[int(corner[0] + c * step), int(corner[1] + r * step)] = True


def _halved(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether any of each 2 x 2 cells is set."""
    rows, columns = cells.shape
    padded = np.zeros((rows + rows % 2, columns + columns % 2), np.bool_)
    padded[:rows, :columns] = cells
    halved: NDArray[np.bool_] = padded[::2] | padded[1::2]
    return np.ascontiguousarray(halved[:, ::2] | halved[:, 1::2])
