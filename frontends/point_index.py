"""Points with normals in a grid of cells, for finding the nearest one in constant time."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats

MAX_CELLS = 1_000_000


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
    low, high = _bounds(points)
    extent = np.maximum(high - low, cell_m)
    cell_m = max(cell_m, float(np.sqrt(extent[0] * extent[1] / MAX_CELLS)))
    rows, columns = (int(n) + 1 for n in (high - low) / cell_m)
    return PointIndex(*_sort_by_cell(points, normals, low, cell_m, rows, columns), low, cell_m, rows, columns)


@njit(cache=True)
def _bounds(points: Floats) -> tuple[Floats, Floats]:
    low, high = points[0].copy(), points[0].copy()
    for i in range(points.shape[0]):
        for axis in range(2):
            low[axis] = min(low[axis], points[i, axis])
            high[axis] = max(high[axis], points[i, axis])
    return low, high


@njit(cache=True)
def _sort_by_cell(
    points: Floats, normals: Floats, origin: Floats, cell_m: float, rows: int, columns: int
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    n = points.shape[0]
    cells = np.empty(n, np.int64)
    starts = np.zeros(rows * columns + 1, np.int64)
    for i in range(n):
        row = int((points[i, 0] - origin[0]) / cell_m)
        column = int((points[i, 1] - origin[1]) / cell_m)
        cells[i] = row * columns + column
        starts[cells[i] + 1] += 1
    for c in range(rows * columns):
        starts[c + 1] += starts[c]
    cursor = starts[:-1].copy()
    sorted_points, sorted_normals = np.empty_like(points), np.empty_like(normals)
    for i in range(n):
        row = cursor[cells[i]]
        sorted_points[row] = points[i]
        sorted_normals[row] = normals[i]
        cursor[cells[i]] += 1
    return sorted_points, sorted_normals, starts


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
    row = int(np.floor((x - origin[0]) / cell_m))
    column = int(np.floor((y - origin[1]) / cell_m))
    best, best_d2 = -1, gate_m * gate_m
    for r in range(max(row - 1, 0), min(row + 2, rows)):
        c0, c1 = max(column - 1, 0), min(column + 2, columns)
        if c0 >= c1:
            continue
        for k in range(starts[r * columns + c0], starts[r * columns + c1]):
            dx, dy = points[k, 0] - x, points[k, 1] - y
            d2 = dx * dx + dy * dy
            if d2 < best_d2:
                best, best_d2 = k, d2
    return best
