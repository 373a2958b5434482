"""Scans at poses -> occupancy grid, in log-odds, ray by ray.

The inverse sensor model is OctoMap's (Hornung et al. 2013, section 3.2): a fixed step up where a ray ends, a fixed
step down where it passes, clamped. Within one scan a cell moves once, and a hit wins over a ray that passes
(section 5.1 there): otherwise the rays that graze a wall would erase it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.options import option

Floats = NDArray[np.float64]
Points = NDArray[np.float32] | NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MapConfig:
    """How the occupancy grid is drawn and written."""

    resolution_m: float = option(0.05, "m", "Nav2's and slam_toolbox's default; a door frame is two cells")
    max_range_m: float = option(30.0, "m", "a UST-20LX's reach; beyond it a beam is wider than two cells")
    hit_log_odds: float = option(0.85, "", "p = 0.70, OctoMap's; one hit is occupied (0.65)")
    miss_log_odds: float = option(-0.4, "", "p = 0.40, OctoMap's; three passes are free (0.25), two undo one hit")
    min_log_odds: float = option(-2.0, "", "OctoMap's clamp: four hits turn a cell that was free for long")
    max_log_odds: float = option(3.5, "", "OctoMap's clamp: what moved away is gone after a dozen passes")
    occupied_probability: float = option(0.65, "", "Nav2's occupied_thresh")
    free_probability: float = option(0.25, "", "Nav2's free_thresh")
    clear_no_return: bool = option(False, "", "glass and black paint give no return either, and are not free space")
    margin_m: float = option(1.0, "m", "unknown cells around what was seen, so that a planner sees the map's end")
    max_cells: int = option(30_000_000, "cells", "150 MB while drawing; 270 x 270 m at 5 cm, then coarser")


@dataclass(frozen=True, slots=True, eq=False)
class GridScan:
    """One scan in base_link: `hits` (m, 2) m, where its rays ended, seen from `sensor_xy_m`.

    `no_returns` (k, 2) m are points on the rays that met nothing, as far out as they are known to be empty; used with
    `clear_no_return` alone. Points that are not finite are passed over.
    """

    hits: Points
    sensor_xy_m: tuple[float, float] = (0.0, 0.0)
    no_returns: Points = field(default_factory=lambda: np.empty((0, 2), np.float32))


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """`log_odds` (rows, columns) float32, 0 unknown; cell [0, 0]'s lower-left corner is `origin_xy_m` in `map`.

    Row 0 has the lowest y. `coarsening` is how many times wider a cell is than asked for (1: as asked), where the
    extent would have taken more than `max_cells`.
    """

    log_odds: NDArray[np.float32]
    resolution_m: float
    origin_xy_m: tuple[float, float]
    coarsening: int = 1

    def probability(self) -> NDArray[np.float32]:
        """(rows, columns) float32 in (0, 1), 0.5 where unknown."""
        return (1 / (1 + np.exp(-self.log_odds))).astype(np.float32, copy=False)


def build_grid(poses: Floats, scans: Sequence[GridScan], config: MapConfig) -> OccupancyGrid:
    """The grid of `scans` at `poses` (n, 3), T_map_base of each; without scans it is small and unknown all over.

    Scans whose pose is not finite are passed over. Raises ValueError where the counts differ.
    """
    canvas = _canvas(_extent(poses, scans, config), config)
    for pose, scan in zip(poses, scans, strict=True):
        canvas.insert(_rays(pose, scan, config), config)
    return OccupancyGrid(canvas.log_odds, canvas.resolution_m, canvas.origin_xy_m, canvas.coarsening)


class _Rays(NamedTuple):
    """Rays of one scan in `map`: from `origin` (2,) to `ends` (n, 2), m; the first `hits` of them hit something."""

    origin: Floats
    ends: Floats
    hits: int


def _rays(pose: Floats, scan: GridScan, config: MapConfig) -> _Rays:
    """The rays of `scan` at `pose`, cut at the range's end: a hit beyond it is a ray that met nothing up to there."""
    if not np.isfinite(pose).all():
        return _Rays(np.empty((0, 2)), np.empty((0, 2)), 0)
    sensor = np.array(scan.sensor_xy_m)
    hits, far = _within(scan.hits - sensor, config.max_range_m)
    parts = [hits, far]
    if config.clear_no_return:
        parts.extend(_within(scan.no_returns - sensor, config.max_range_m))
    c, s = math.cos(pose[2]), math.sin(pose[2])
    R_transposed = np.array([[c, s], [-s, c]])
    ends = np.concatenate(parts) + sensor
    return _Rays(sensor @ R_transposed + pose[:2], ends @ R_transposed + pose[:2], len(hits))


def _within(vectors: Floats, range_m: float) -> tuple[Floats, Floats]:
    """The finite (n, 2) `vectors` no longer than `range_m`, and the longer ones cut to it."""
    length = np.hypot(vectors[:, 0], vectors[:, 1])
    far = np.isfinite(length) & (length > range_m)
    return vectors[length <= range_m], vectors[far] * (range_m / length[far])[:, None]


def _extent(poses: Floats, scans: Sequence[GridScan], config: MapConfig) -> Floats:
    """(2, 2) lowest and highest x, y (m) that a ray reaches; the origin of `map` where there is none."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for pose, scan in zip(poses, scans, strict=True):
        rays = _rays(pose, scan, config)
        for points in (np.atleast_2d(rays.origin), rays.ends):
            low = np.minimum(low, points.min(axis=0, initial=np.inf))
            high = np.maximum(high, points.max(axis=0, initial=-np.inf))
    return np.stack([low, high]) if np.isfinite(low).all() else np.zeros((2, 2))


class _Canvas:
    """A grid while it is drawn; `seen` remembers which cells the present scan has moved."""

    def __init__(
        self, shape: tuple[int, int], resolution_m: float, origin_xy_m: tuple[float, float], coarsening: int
    ) -> None:
        self.log_odds = np.zeros(shape, np.float32)
        self.resolution_m = resolution_m
        self.origin_xy_m = origin_xy_m
        self.coarsening = coarsening
        self._seen = np.zeros(shape, np.uint8)
        self._serial = 0

    def insert(self, rays: _Rays, config: MapConfig) -> None:
        """Draws the rays of one scan."""
        if len(rays.ends) == 0:
            return
        steps = (config.hit_log_odds, config.miss_log_odds, config.min_log_odds, config.max_log_odds)
        start = self._cells(rays.origin)
        _draw(self.log_odds, self._seen, self._next_serial(), start, self._cells(rays.ends), rays.hits, steps)

    def _next_serial(self) -> int:
        self._serial += 1
        if self._serial > np.iinfo(np.uint8).max:
            self._seen[:] = 0
            self._serial = 1
        return self._serial

    def _cells(self, points: Floats) -> NDArray[np.int64]:
        """(..., 2) row and column of (..., 2) points x, y."""
        cells = np.floor((points - self.origin_xy_m) / self.resolution_m).astype(np.int64)
        return np.ascontiguousarray(cells[..., ::-1])


def _canvas(extent: Floats, config: MapConfig) -> _Canvas:
    """An empty canvas around `extent`, its cells doubled until no more than `max_cells` are needed."""
    low, high = extent[0] - config.margin_m, extent[1] + config.margin_m
    coarsening = 1
    while True:
        resolution_m = config.resolution_m * coarsening
        first = np.floor(low / resolution_m)
        columns, rows = np.floor(high / resolution_m) - first + 1
        if rows * columns <= config.max_cells:
            origin = (float(first[0] * resolution_m), float(first[1] * resolution_m))
            return _Canvas((int(rows) + 1, int(columns) + 1), resolution_m, origin, coarsening)
        coarsening *= 2


@njit(cache=True)
def _draw(
    log_odds: NDArray[np.float32],
    seen: NDArray[np.uint8],
    serial: int,
    start: NDArray[np.int64],
    ends: NDArray[np.int64],
    hits: int,
    steps: tuple[float, float, float, float],
) -> None:
    """One scan: the cells `ends` (n, 2) of the first `hits` rays go up, the cells before them (Bresenham) go down."""
    hit, miss, low, high = steps
    odds, moved, columns = log_odds.ravel(), seen.ravel(), log_odds.shape[1]
    for i in range(hits):
        cell = ends[i, 0] * columns + ends[i, 1]
        if moved[cell] != serial:
            moved[cell] = serial
            odds[cell] = min(odds[cell] + hit, high)
    for i in range(len(ends)):
        d_row, d_column = ends[i, 0] - start[0], ends[i, 1] - start[1]
        along = columns if d_row > 0 else -columns
        across = 1 if d_column > 0 else -1
        longer, shorter = abs(d_row), abs(d_column)
        if shorter > longer:
            along, across, longer, shorter = across, along, shorter, longer
        cell = start[0] * columns + start[1]
        error = longer // 2
        for _ in range(longer):
            if moved[cell] != serial:
                moved[cell] = serial
                odds[cell] = max(odds[cell] + miss, low)
            error -= shorter
            if error < 0:
                cell += across
                error += longer
            cell += along
