"""Points with normals in a grid of cells, for finding the nearest one in constant time."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats

ROUNDING_M = 1e-6  # by which a point may seem to lie in the next cell
MAX_CELLS = 1_000_000  # bounds the memory of `starts` to 8 MB, however far a false point lies: 500 x 500 m at 0.5 m


class CellGrid(NamedTuple):
    """Points sorted by the cell of their x and y: cell (i, j) holds rows `starts[i * columns + j]` up to the next.

    The cells have side `cell_m`; the lower corner of cell (0, 0) is `origin` (2,) m.
    """

    starts: NDArray[np.int64]
    origin: Floats
    cell_m: float
    rows: int
    columns: int


class PointIndex(NamedTuple):
    """`points` (n, 2) m and `normals` (n, 2; NaN where unknown), sorted by cell."""

    points: Floats
    normals: Floats
    cells: CellGrid


def build_index(points: Floats, normals: Floats, cell_m: float) -> PointIndex:
    """The index of `points` (n >= 1, 2) with `normals` (n, 2); see `sort_by_cell` for the cells."""
    order, cells = sort_by_cell(points, cell_m)
    return PointIndex(points[order], normals[order], cells)


@njit(cache=True)
def sort_by_cell(points: Floats, cell_m: float) -> tuple[NDArray[np.int64], CellGrid]:
    """The order (n,) of `points` (n >= 1, 2 or more) by the cells of their x and y, and these cells.

    Cells are larger than `cell_m` where the extent would need more than MAX_CELLS.
    """
    low, high = _bounds(points)
    width, height = max(high[0] - low[0], cell_m), max(high[1] - low[1], cell_m)
    cell_m = max(cell_m, np.sqrt(width * height / MAX_CELLS))
    rows, columns = int((high[0] - low[0]) / cell_m) + 1, int((high[1] - low[1]) / cell_m) + 1
    n = points.shape[0]
    cells, order = np.empty(n, np.int64), np.empty(n, np.int64)
    starts = np.zeros(rows * columns + 1, np.int64)
    for i in range(n):
        cells[i] = int((points[i, 0] - low[0]) / cell_m) * columns + int((points[i, 1] - low[1]) / cell_m)
        starts[cells[i] + 1] += 1
    starts = np.cumsum(starts)
    cursor = starts[:-1].copy()
    for i in range(n):
        order[cursor[cells[i]]] = i
        cursor[cells[i]] += 1
    return order, CellGrid(starts, low, cell_m, rows, columns)


@njit(cache=True)
def _bounds(points: Floats) -> tuple[Floats, Floats]:
    """The lowest and the highest x, y (2,) of the points."""
    low, high = points[0, :2].copy(), points[0, :2].copy()
    for i in range(points.shape[0]):
        for axis in range(2):
            low[axis] = min(low[axis], points[i, axis])
            high[axis] = max(high[axis], points[i, axis])
    return low, high


@njit(cache=True, inline="always")  # as below
def block_around(x: float, y: float, cells: CellGrid) -> tuple[int, int, int, int]:
    """The 3 x 3 cells around (x, y) m that exist: first row, last row (excluded), first column, last (excluded)."""
    row = int(np.floor((x - cells.origin[0]) / cells.cell_m))
    column = int(np.floor((y - cells.origin[1]) / cells.cell_m))
    left, right = max(column - 1, 0), min(column + 2, cells.columns)
    if left >= right:
        return 0, 0, 0, 0
    return max(row - 1, 0), min(row + 2, cells.rows), left, right


@njit(cache=True, inline="always")  # as below
def block_within(x: float, y: float, reach_m: float, cells: CellGrid) -> tuple[int, int, int, int]:
    """The cells that hold what is within `reach_m` of (x, y) m along both axes, as of `block_around`."""
    row, column = (x - cells.origin[0]) / cells.cell_m, (y - cells.origin[1]) / cells.cell_m
    reach = reach_m / cells.cell_m
    left, right = max(int(np.floor(column - reach)), 0), min(int(np.floor(column + reach)) + 1, cells.columns)
    if left >= right:
        return 0, 0, 0, 0
    return max(int(np.floor(row - reach)), 0), min(int(np.floor(row + reach)) + 1, cells.rows), left, right


@njit(cache=True, inline="always")  # a tenth of ICP's time
def nearest(x: float, y: float, gate_m: float, points: Floats, cells: CellGrid) -> int:
    """Row of the point nearest to (x, y) m within `gate_m`, which is at most a cell's side; -1 if there is none."""
    top, bottom, left, right = block_within(x, y, gate_m + ROUNDING_M, cells)
    best, best_d2 = -1, gate_m * gate_m
    starts, columns = cells.starts, cells.columns
    for r in range(top, bottom):
        for k in range(starts[r * columns + left], starts[r * columns + right]):
            dx, dy = points[k, 0] - x, points[k, 1] - y
            d2 = dx * dx + dy * dy
            if d2 < best_d2:
                best, best_d2 = k, d2
    return best
