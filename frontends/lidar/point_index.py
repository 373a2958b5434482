"""Points with normals in a grid of cells, for finding the nearest one in constant time."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats

MAX_CELLS = 1_000_000

Cells = tuple[NDArray[np.int64], Floats, float, int, int]  # starts, origin, cell_m, rows, columns of a PointIndex


@dataclass(frozen=True, slots=True, eq=False)
class PointIndex:
    """`points` (n, 2) and `normals` (n, 2; NaN where none is known), sorted by cell; m.

    Cell (i, j), of side `cell_m`, holds rows `starts[i * columns + j]` up to the next start.
    """

    points: Floats
    normals: Floats
    starts: NDArray[np.int64]
    origin: Floats
    cell_m: float
    rows: int
    columns: int


def build_index(points: Floats, normals: Floats, cell_m: float) -> PointIndex:
    """The index of `points` (n >= 1, 2) with `normals` (n, 2); points beyond MAX_CELLS cells make the cells larger."""
    order, cells = sort_by_cell(points, cell_m)
    return PointIndex(points[order], normals[order], *cells)


@njit(cache=True)
def sort_by_cell(points: Floats, cell_m: float) -> tuple[NDArray[np.int64], Cells]:
    """The order (n,) of `points` (n >= 1, 2 or more) by the cells of their x and y, and these cells.

    More than MAX_CELLS of them are not made: they get larger than `cell_m`.
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
    return order, (starts, low, cell_m, rows, columns)


@njit(cache=True)
def _bounds(points: Floats) -> tuple[Floats, Floats]:
    low, high = points[0, :2].copy(), points[0, :2].copy()
    for i in range(points.shape[0]):
        for axis in range(2):
            low[axis] = min(low[axis], points[i, axis])
            high[axis] = max(high[axis], points[i, axis])
    return low, high


@njit(cache=True)
def block_around(
    x: float, y: float, origin: Floats, cell_m: float, rows: int, columns: int
) -> tuple[int, int, int, int]:
    """The 3 x 3 cells around (x, y) m, as far as there are any: first row, last (excluded), first column, last."""
    row, column = int(np.floor((x - origin[0]) / cell_m)), int(np.floor((y - origin[1]) / cell_m))
    left, right = max(column - 1, 0), min(column + 2, columns)
    if left >= right:
        return 0, 0, 0, 0
    return max(row - 1, 0), min(row + 2, rows), left, right


@njit(cache=True)
def nearest(
    x: float,
    y: float,
    gate_m: float,
    points: Floats,
    starts: NDArray[np.int64],
    origin: Floats,
    cell_m: float,
    rows: int,
    columns: int,
) -> int:
    """Row of the point nearest to (x, y) within `gate_m`, which is at most a cell's side; -1 if there is none."""
    top, bottom, left, right = block_around(x, y, origin, cell_m, rows, columns)
    best, best_d2 = -1, gate_m * gate_m
    for r in range(top, bottom):
        for k in range(starts[r * columns + left], starts[r * columns + right]):
            dx, dy = points[k, 0] - x, points[k, 1] - y
            d2 = dx * dx + dy * dy
            if d2 < best_d2:
                best, best_d2 = k, d2
    return best
