"""Draws scans at poses into one patch of the occupancy grid, ray by ray, with the inverse sensor model.

Within one scan a cell changes once, and a hit wins over a ray that passes (Hornung et al. 2013, section 5.1): otherwise
the rays that graze a wall would erase it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.grid.patch import EMPTY, CellWindow, Patch
from wayfi.backend.grid.sensor_model import HIT, PASS
from wayfi.backend.pose2 import Floats

SHARED_CELLS = 0.7  # apart, or less: two rays leave a third one between them hardly any cell of its own
FILL_CELLS = 2  # between the ends of the rays that fill a gap: the next scans' rays pass through the cells left out
BORDER = 1  # cells around those drawn, so that each of these has eight neighbours
MIN_SPACING = 1e-9  # cells: rays of one direction never part; keeps the division finite

Points = NDArray[np.float32] | NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class GridScan:
    """One scan in base_link: `hits` (m, 2) m in the order of the beams, from a sensor at `sensor_xy_m`.

    Points that are not finite are skipped.
    """

    hits: Points
    sensor_xy_m: tuple[float, float] = (0.0, 0.0)


def draw_patch(scans: Sequence[GridScan], poses: Floats, cell_m: float, config: MapConfig) -> Patch:
    """The evidence of at most MAX_SCANS scans at `poses` (m, 3), T_map_base of each; their order does not matter.

    A hit beyond `max_range_m` is a ray that passes up to there. A scan whose pose is not finite is skipped.
    """
    starts, rays = [], []
    for scan, pose in zip(scans, poses, strict=True):
        if len(scan.hits) and np.isfinite(pose).all():
            c, s = math.cos(pose[2]), math.sin(pose[2])
            starts.append((pose[:2] + np.array([[c, -s], [s, c]]) @ scan.sensor_xy_m) / cell_m)
            sensor, max_cells = np.array(scan.sensor_xy_m), config.max_range_m / cell_m
            measured = _rays_to(scan.hits, sensor, c / cell_m, s / cell_m, max_cells)
            rays.append(_with_gaps_filled(measured, config.min_gap_rad, config.max_gap_rad))
    if not rays:
        return Patch(EMPTY)
    patch = Patch(_window_of([_extent(start, scan_rays) for start, scan_rays in zip(starts, rays, strict=True)]))
    corner, marks = np.array([patch.window.column, patch.window.row]), np.zeros_like(patch.evidence)
    for start, scan_rays in zip(starts, rays, strict=True):
        _draw_scan(patch.evidence, marks, start - corner, scan_rays)
    return Patch(patch.window, _thinned_walls(patch.evidence))


def _window_of(extents: Sequence[Floats]) -> CellWindow:
    """The cells of all `extents` (2, 2), with a border."""
    sides = np.floor(extents).astype(np.int64)
    (column, row), (column_last, row_last) = sides[:, 0].min(axis=0).tolist(), sides[:, 1].max(axis=0).tolist()
    return CellWindow(row, column, row_last + 1, column_last + 1).padded(BORDER)


@njit(cache=True)
def _rays_to(points: Points, sensor: Floats, cosine: float, sine: float, max_cells: float) -> Floats:
    """(n, 4) rays to (n, 2) points: unit direction x, y in `map`, length in cells, and 1 where they hit something.

    They end after `max_cells`; those to points that are not finite have length 0. `cosine` and `sine` of the heading
    are divided by the width of a cell.
    """
    rays = np.zeros((len(points), 4))
    for i in range(len(points)):
        x, y = points[i, 0] - sensor[0], points[i, 1] - sensor[1]
        along, across = cosine * x - sine * y, sine * x + cosine * y
        length = math.sqrt(along * along + across * across)
        if 0 < length < np.inf:
            rays[i, 0], rays[i, 1], rays[i, 3] = along / length, across / length, length <= max_cells
            rays[i, 2] = min(length, max_cells)
    return rays


@njit(cache=True)
def _with_gaps_filled(rays: Floats, min_gap_rad: float, max_gap_rad: float) -> Floats:
    """The rays, and between two that a gap of several beams without a return separates, more that hit nothing.

    Down a long corridor no beam returns, though it is free. The filling rays are as long as the shorter of the two,
    and end on the line between their ends: so they do not pass a pane of glass between its frames.
    """
    fill = np.zeros(len(rays), np.int64)
    for i in range(len(rays) - 1):
        gap = math.acos(min(rays[i, 0] * rays[i + 1, 0] + rays[i, 1] * rays[i + 1, 1], 1.0))
        if min_gap_rad < gap < max_gap_rad:
            fill[i] = int(gap * min(rays[i, 2], rays[i + 1, 2]) / FILL_CELLS)
    filled = np.zeros((len(rays) + fill.sum(), 4))
    k = 0
    for i in range(len(rays)):
        filled[k] = rays[i]
        for j in range(1, fill[i] + 1):
            share = j / (fill[i] + 1)
            x, y = (1 - share) * rays[i, 0] + share * rays[i + 1, 0], (1 - share) * rays[i, 1] + share * rays[i + 1, 1]
            chord = math.sqrt(x * x + y * y)
            filled[k + j, 0], filled[k + j, 1] = x / chord, y / chord
            filled[k + j, 2] = chord * min(rays[i, 2], rays[i + 1, 2])
        k += 1 + fill[i]
    return filled


@njit(cache=True)
def _extent(start: Floats, rays: Floats) -> Floats:
    """(2, 2) lowest and highest x, y of the rays' ends and their start, in cells."""
    extent = np.empty((2, 2))
    extent[0], extent[1] = start, start
    for i in range(len(rays)):
        for axis in range(2):
            end = start[axis] + rays[i, axis] * rays[i, 2]
            extent[0, axis], extent[1, axis] = min(extent[0, axis], end), max(extent[1, axis], end)
    return extent


@njit(cache=True)
def _draw_scan(evidence: NDArray[np.int8], marks: NDArray[np.int8], start: Floats, rays: Floats) -> None:
    """Add one scan from `start`, in cells, to the evidence; `marks`, of the same shape, is zero before and after."""
    x, y, columns, cells = start[0], start[1], evidence.shape[1], marks.ravel()
    for i in range(len(rays)):
        begin, end = _first_own_cell(rays, i), rays[i, 2]
        if begin < end:
            dx, dy = rays[i, 0], rays[i, 1]
            _mark_line(cells, columns, int(x + dx * begin), int(y + dy * begin), int(x + dx * end), int(y + dy * end))
    for i in range(len(rays)):
        if rays[i, 3] > 0:
            cells[int(y + rays[i, 1] * rays[i, 2]) * columns + int(x + rays[i, 0] * rays[i, 2])] = HIT
    extent = _extent(start, rays)
    first, last = int(extent[0, 0]), int(extent[1, 0]) + 1
    for row in range(int(extent[0, 1]), int(extent[1, 1]) + 1):
        _add_and_clear(marks[row, first:last], evidence[row, first:last])


@njit(cache=True)
def _first_own_cell(rays: Floats, i: int) -> float:
    """How far out, in cells, ray `i` begins to meet cells that rays drawn further in do not.

    Near the sensor many rays share a cell. So ray `i` is drawn only from where the two rays `step` to its sides have
    parted, or one of them has ended; `step` is the greatest power of two that divides `i`. Rays of a larger step are
    fewer, and begin nearer to the sensor.
    """
    step = i & -i
    a, b = i - step, i + step
    if i == 0 or b >= len(rays):
        return 0.0
    apart: float = math.hypot(rays[a, 0] - rays[b, 0], rays[a, 1] - rays[b, 1])
    shared: float = min(rays[a, 2], rays[b, 2], SHARED_CELLS / max(apart, MIN_SPACING))
    return max(shared - 1.0, 0.0)


@njit(cache=True)
def _mark_line(cells: NDArray[np.int8], columns: int, x: int, y: int, x_end: int, y_end: int) -> None:
    """Marks the cells from (x, y) to (x_end, y_end), the last excluded, as passed (Bresenham)."""
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
def _add_and_clear(marks: NDArray[np.int8], evidence: NDArray[np.int8]) -> None:
    """Add the marks of one row to its evidence, and sets them to zero."""
    for i in range(len(marks)):
        evidence[i] += marks[i]
        marks[i] = 0


@njit(cache=True)
def _thinned_walls(evidence: NDArray[np.int8]) -> NDArray[np.int8]:
    """The evidence without the fringes that range noise gives a wall (non-maximum suppression).

    An occupied cell becomes unknown next to a neighbour with more than twice its evidence.
    """
    thinned = evidence.copy()
    for row in range(1, evidence.shape[0] - 1):
        for column in range(1, evidence.shape[1] - 1):
            if evidence[row, column] > 0 and _max_around(evidence, row, column) > 2 * evidence[row, column]:
                thinned[row, column] = 0
    return thinned


@njit(cache=True)
def _max_around(evidence: NDArray[np.int8], row: int, column: int) -> int:
    """The greatest evidence of a cell and its eight neighbours."""
    most: int = evidence[row, column]
    for i in range(row - 1, row + 2):
        for j in range(column - 1, column + 2):
            most = max(most, evidence[i, j])
    return most
