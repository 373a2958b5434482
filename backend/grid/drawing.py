"""Scans at poses -> one patch of the occupancy grid, ray by ray.

The inverse sensor model is OctoMap's (Hornung et al. 2013, section 3.2): a fixed step up where a ray ends, a fixed step
down where it passes. Within one scan a cell moves once, and a hit wins over a ray that passes (section 5.1 there):
otherwise the rays that graze a wall would erase it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.grid.patch import NOWHERE, CellWindow, Patch

HIT, PASS = 3, -1  # of 2, rays that graze a wall from afar erase a twentieth of all walls; of 4, specks stay
COVERED = 0.7  # of a cell: nearer to each other than this, two rays leave a third between them hardly any cell
BRIDGE_CELLS = 2  # between the ends of rays across a gap: the next scan passes what they leave
LEAST_GAP, MOST_GAP = math.radians(2), math.radians(20)  # a beam lost is no gap; a black car near by is wider
BORDER = 1  # cells, so that every cell has its neighbours
MOST_SCANS = 40  # in one patch: what they say of a cell stays within an int8

Floats = NDArray[np.float64]
Points = NDArray[np.float32] | NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class GridScan:
    """One scan in base_link: `hits` (m, 2) m, in the order of the beams, seen from `sensor_xy_m`.

    Points that are not finite are passed over.
    """

    hits: Points
    sensor_xy_m: tuple[float, float] = (0.0, 0.0)


def draw_patch(scans: Sequence[GridScan], poses: Floats, cell_m: float, max_range_m: float) -> Patch:
    """What at most `MOST_SCANS` scans at `poses` (m, 3), T_map_base of each, say together; their order is all one.

    A hit beyond `max_range_m` is a ray that passes up to there. A scan whose pose is not finite is passed over.
    """
    starts, rays = [], []
    for scan, pose in zip(scans, poses, strict=True):
        if len(scan.hits) and np.isfinite(pose).all():
            c, s = math.cos(pose[2]), math.sin(pose[2])
            starts.append((pose[:2] + np.array([[c, -s], [s, c]]) @ scan.sensor_xy_m) / cell_m)
            aimed = _aim(scan.hits, np.array(scan.sensor_xy_m), c / cell_m, s / cell_m, max_range_m / cell_m)
            rays.append(_bridged(aimed))
    if not rays:
        return Patch(NOWHERE)
    patch = Patch(_around([_reach(start, scan_rays) for start, scan_rays in zip(starts, rays, strict=True)]))
    corner, seen = np.array([patch.window.column, patch.window.row]), np.zeros_like(patch.evidence)
    for start, scan_rays in zip(starts, rays, strict=True):
        _draw_scan(patch.evidence, seen, start - corner, scan_rays)
    return Patch(patch.window, _sharpened(patch.evidence))


def _around(reaches: Sequence[Floats]) -> CellWindow:
    """The cells of all `reaches`, with a border."""
    sides = np.floor(reaches).astype(np.int64)
    (column, row), (column_last, row_last) = sides[:, 0].min(axis=0).tolist(), sides[:, 1].max(axis=0).tolist()
    return CellWindow(row, column, row_last + 1, column_last + 1).grown(BORDER)


@njit(cache=True)
def _aim(points: Points, sensor: Floats, cosine: float, sine: float, most: float) -> Floats:
    """(n, 4) rays to (n, 2) points: the direction x, y in `map`, how many cells far, and 1 where they hit something.

    They end after `most` cells; those to what is not finite have none. `cosine` and `sine` of the heading are over the
    width of a cell.
    """
    rays = np.zeros((len(points), 4))
    for i in range(len(points)):
        x, y = points[i, 0] - sensor[0], points[i, 1] - sensor[1]
        along, across = cosine * x - sine * y, sine * x + cosine * y
        length = math.sqrt(along * along + across * across)
        if 0 < length < np.inf:
            rays[i, 0], rays[i, 1], rays[i, 2], rays[i, 3] = along / length, across / length, length, length <= most
            rays[i, 2] = min(length, most)
    return rays


@njit(cache=True)
def _bridged(rays: Floats) -> Floats:
    """The rays, and between two that several beams without a return lie between, more that hit nothing.

    Down a long corridor no beam comes back, and it is free all the same: as far as the beams at both sides say, up to
    the line between their ends. So a pane of glass between its frames is not passed.
    """
    across = np.zeros(len(rays), np.int64)
    for i in range(len(rays) - 1):
        gap = math.acos(min(rays[i, 0] * rays[i + 1, 0] + rays[i, 1] * rays[i + 1, 1], 1.0))
        if LEAST_GAP < gap < MOST_GAP:
            across[i] = int(gap * min(rays[i, 2], rays[i + 1, 2]) / BRIDGE_CELLS)
    bridged = np.zeros((len(rays) + across.sum(), 4))
    k = 0
    for i in range(len(rays)):
        bridged[k] = rays[i]
        for j in range(1, across[i] + 1):
            share = j / (across[i] + 1)
            x, y = (1 - share) * rays[i, 0] + share * rays[i + 1, 0], (1 - share) * rays[i, 1] + share * rays[i + 1, 1]
            inwards = math.sqrt(x * x + y * y)
            bridged[k + j, 0], bridged[k + j, 1] = x / inwards, y / inwards
            bridged[k + j, 2] = inwards * min(rays[i, 2], rays[i + 1, 2])
        k += 1 + across[i]
    return bridged


@njit(cache=True)
def _reach(start: Floats, rays: Floats) -> Floats:
    """(2, 2) lowest and highest x, y that rays get to, in cells."""
    reach = np.empty((2, 2))
    reach[0], reach[1] = start, start
    for i in range(len(rays)):
        for axis in range(2):
            end = start[axis] + rays[i, axis] * rays[i, 2]
            reach[0, axis], reach[1, axis] = min(reach[0, axis], end), max(reach[1, axis], end)
    return reach


@njit(cache=True)
def _draw_scan(evidence: NDArray[np.int8], seen: NDArray[np.int8], start: Floats, rays: Floats) -> None:
    """Adds one scan from `start`, in cells of `evidence`; `seen` is empty before and after."""
    x, y, columns, cells = start[0], start[1], evidence.shape[1], seen.ravel()
    for i in range(len(rays)):
        begin, end = _uncovered_from(rays, i), rays[i, 2]
        if begin < end:
            dx, dy = rays[i, 0], rays[i, 1]
            _pass(cells, columns, int(x + dx * begin), int(y + dy * begin), int(x + dx * end), int(y + dy * end))
    for i in range(len(rays)):
        if rays[i, 3] > 0:
            cells[int(y + rays[i, 1] * rays[i, 2]) * columns + int(x + rays[i, 0] * rays[i, 2])] = HIT
    reach = _reach(start, rays)
    first, last = int(reach[0, 0]), int(reach[1, 0]) + 1
    for row in range(int(reach[0, 1]), int(reach[1, 1]) + 1):
        _move(seen[row, first:last], evidence[row, first:last])


@njit(cache=True)
def _uncovered_from(rays: Floats, i: int) -> float:
    """How far out, in cells, ray `i` begins to meet cells that those drawn further in do not.

    Near the sensor the rays are many to a cell: all of a scan meet there. So every second begins only where its two
    neighbours have parted or one has ended; of the others every second again, its neighbours two off; ...
    """
    step = i & -i
    a, b = i - step, i + step
    if i == 0 or b >= len(rays):
        return 0.0
    apart: float = math.hypot(rays[a, 0] - rays[b, 0], rays[a, 1] - rays[b, 1])
    covered: float = min(rays[a, 2], rays[b, 2], COVERED / max(apart, 1e-9))
    return max(covered - 1.0, 0.0)


@njit(cache=True)
def _pass(cells: NDArray[np.int8], columns: int, x: int, y: int, x_end: int, y_end: int) -> None:
    """Marks the cells from (x, y) to (x_end, y_end), the last excluded (Bresenham)."""
    dx, dy = x_end - x, y_end - y
    along = columns if dy > 0 else -columns
    across = 1 if dx > 0 else -1
    longer, shorter = abs(dy), abs(dx)
    if shorter > longer:
        along, across, longer, shorter = across, along, shorter, longer
    cell = y * columns + x
    error = longer // 2
    for _ in range(longer):
        cells[cell] = PASS
        error -= shorter
        if error < 0:
            cell += across
            error += longer
        cell += along


@njit(cache=True)
def _move(seen: NDArray[np.int8], evidence: NDArray[np.int8]) -> None:
    """Adds what was seen in one row to its evidence, and forgets it."""
    for i in range(len(seen)):
        evidence[i] += seen[i]
        seen[i] = 0


@njit(cache=True)
def _sharpened(evidence: NDArray[np.int8]) -> NDArray[np.int8]:
    """Without the fringes that the noise of ranges gives a wall: a cell gives way to a neighbour with twice as much."""
    sharp = evidence.copy()
    for row in range(1, evidence.shape[0] - 1):
        for column in range(1, evidence.shape[1] - 1):
            if evidence[row, column] > 0 and _most_around(evidence, row, column) > 2 * evidence[row, column]:
                sharp[row, column] = 0
    return sharp


@njit(cache=True)
def _most_around(evidence: NDArray[np.int8], row: int, column: int) -> int:
    """The most evidence of a cell and its eight neighbours."""
    most: int = evidence[row, column]
    for i in range(row - 1, row + 2):
        for j in range(column - 1, column + 2):
            most = max(most, evidence[i, j])
    return most
