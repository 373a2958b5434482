"""The occupancy grid of scans at poses, submap by submap: a correction redraws only the submaps that it moved.

Consecutive keyframes form a submap; their scans are drawn into a patch of cells at their present poses. The patches are
added up in the order of the drive, so that newer evidence wins.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.grid.drawing import GridScan, Points, draw_patch
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.grid.patch import EMPTY, CellWindow, Patch, bounding_window
from wayfi.backend.pose2 import Floats, wrap_all

SUBMAP_KEYFRAMES = 20  # 10 m: drawn in 4 ms, moved by a closure almost as one, and no more than MAX_SCANS
REDRAWN_SUBMAPS = 5  # that moved, at one redraw: 100 scans, 20 ms
REDRAW_KEYFRAMES = 10  # with scans, between two redraws: a new grid every 5 m
CELLS_PER_KEYFRAME = 100_000  # of map: a larger redraw waits for more keyframes
MERGED_PER_CELL = 10  # cells that count as one of map: merging a cell takes less than a tenth of the time
NO_HITS: Points = np.empty((0, 2), np.float32)
SLACK = 200  # cells that the base grows by at once: 10 m, as many as a submap adds


class GridMap:
    """The grid of a drive: add each keyframe's scan, and redraw it at the present poses."""

    def __init__(self, config: MapConfig) -> None:
        self._config = config
        self._cell_m = config.resolution_m
        self._scans: list[GridScan] = []
        self._patches: list[Patch] = []
        self._drawn = np.full((64, 3), np.nan)  # the pose at which each scan was drawn last, NaN if never
        self._reach_m = np.zeros((64, 2))  # of each scan: root mean square and maximum distance of its points
        self._base = Patch(EMPTY)  # the sum of the first `_in_base` submaps, which are full
        self._in_base = 0
        self._new_scans, self._due_after = 0, REDRAW_KEYFRAMES

    def add(self, hits: Points, sensor_xy_m: tuple[float, float] = (0.0, 0.0)) -> None:
        """Add the next keyframe's scan: `hits` (m, 2) m in base_link, (0, 2) where it has none; see GridScan."""
        number = len(self._scans)
        if number == len(self._drawn):
            self._drawn, self._reach_m = (np.resize(a, (2 * number, a.shape[1])) for a in (self._drawn, self._reach_m))
        if number % SUBMAP_KEYFRAMES == 0:
            self._patches.append(Patch(EMPTY))
        self._scans.append(GridScan(hits, sensor_xy_m))
        self._drawn[number] = np.nan
        self._reach_m[number] = _reach_m(hits, self._config.max_range_m + math.hypot(*sensor_xy_m))
        self._new_scans += len(hits) > 0

    def hits(self) -> list[Points]:
        """The hits of each keyframe's scan, as they were added."""
        return [scan.hits for scan in self._scans]

    def forget(self, first: int) -> None:
        """Remove the hits of the keyframes from number `first` on."""
        self.replace_from(first, [NO_HITS] * (len(self._scans) - first))

    def replace_from(self, first: int, hits: Sequence[Points]) -> None:
        """Replace the hits of the keyframes from number `first` on; all is drawn again."""
        anew = GridMap(self._config)
        for scan, each in zip(self._scans, [*self.hits()[:first], *hits], strict=True):
            anew.add(each, scan.sensor_xy_m)
        vars(self).update(vars(anew))

    @property
    def due(self) -> bool:
        """Whether a redraw is due: enough keyframes with scans have come since the last, more for a larger map."""
        return self._new_scans >= self._due_after

    def redraw(self, poses: Floats) -> OccupancyGrid:
        """The grid at `poses` (n, 3), T_map_base of all keyframes, as far as a bounded number of scans allows.

        Draws new scans, then the submaps that moved furthest; the others stay as they are until a later call.
        Raises ValueError where there are not as many poses as scans.
        """
        most = REDRAWN_SUBMAPS + self._new_scans // SUBMAP_KEYFRAMES
        return self._redraw(poses, self._config.moved_cells * self._cell_m, most)

    def settle(self, poses: Floats) -> OccupancyGrid:
        """The grid with every scan at exactly its pose of `poses` (n, 3); small and unknown without scans.

        Raises ValueError where there are not as many poses as scans.
        """
        return self._redraw(poses, 0.0, len(self._patches))

    def _redraw(self, poses: Floats, tolerance_m: float, most: int) -> OccupancyGrid:
        if len(poses) != len(self._scans):
            raise ValueError(f"{len(poses)} poses of {len(self._scans)} scans")
        self._choose_resolution(poses)
        changed = [self._draw(number, poses) for number in self._moved_submaps(poses, tolerance_m)[:most]]
        merged_cells = self._update_base(bounding_window(changed))
        grid = self.drawn()
        self._new_scans = 0
        self._due_after = max(
            REDRAW_KEYFRAMES, (grid.evidence.size + merged_cells // MERGED_PER_CELL) // CELLS_PER_KEYFRAME
        )
        return grid

    def _choose_resolution(self, poses: Floats) -> None:
        """Double the cells' width until no more than `max_cells` are needed; a change redraws everything."""
        reach_m = self._reach_m[: len(poses), 1:]
        seen = np.isfinite(poses).all(axis=1) & (reach_m[:, 0] > 0)
        cell_m = self._config.resolution_m
        if seen.any():
            low, high = (poses[:, :2] - reach_m)[seen].min(axis=0), (poses[:, :2] + reach_m)[seen].max(axis=0)
            width_m, height_m = high - low + 2 * self._config.margin_m
            while width_m * height_m > self._config.max_cells * cell_m**2:
                cell_m *= 2
        if cell_m != self._cell_m:
            self._cell_m = cell_m
            self._patches = [Patch(EMPTY) for _ in self._patches]
            self._drawn[:] = np.nan
            self._base, self._in_base = Patch(EMPTY), 0

    def _moved_submaps(self, poses: Floats, tolerance_m: float) -> NDArray[np.int64]:
        """The submaps with a scan whose points lie over `tolerance_m` from where they were drawn, furthest first."""
        if len(poses) == 0:
            return np.empty(0, np.int64)
        off = poses - self._drawn[: len(poses)]
        reach_m = self._reach_m[: len(poses), 0]
        shift_m = np.hypot(off[:, 0], off[:, 1]) + np.abs(wrap_all(off[:, 2])) * reach_m
        shift_m = np.where(reach_m > 0, np.nan_to_num(shift_m, nan=np.inf), 0.0)
        furthest_m = np.maximum.reduceat(shift_m, np.arange(0, len(poses), SUBMAP_KEYFRAMES))
        return np.argsort(-furthest_m, kind="stable")[: np.count_nonzero(furthest_m > tolerance_m)]

    def _draw(self, number: int, poses: Floats) -> CellWindow:
        """Draw a submap at its poses; returns the window in which that changes the base."""
        first = number * SUBMAP_KEYFRAMES
        members = slice(first, min(first + SUBMAP_KEYFRAMES, len(poses)))
        before = self._patches[number].window
        self._patches[number] = draw_patch(self._scans[members], poses[members], self._cell_m, self._config)
        self._drawn[members] = poses[members]
        return bounding_window([before, self._patches[number].window]) if number < self._in_base else EMPTY

    def _update_base(self, changed: CellWindow) -> int:
        """Sum the base again in `changed`, and add the submaps that are full now; returns how many cells it touched."""
        self._base = self._base.expanded_to(changed, SLACK)
        self._base.cells(changed)[:] = 0
        touched = sum(self._base.add(patch, changed) for patch in self._patches[: self._in_base])
        full = len(self._scans) // SUBMAP_KEYFRAMES
        for patch in self._patches[self._in_base : full]:
            self._base = self._base.expanded_to(patch.window, SLACK)
            touched += self._base.add(patch, patch.window)
        self._in_base = full
        return touched

    def drawn(self) -> OccupancyGrid:
        """The grid as it was drawn last: the sum of all patches, with a margin of unknown cells."""
        margin = math.ceil(self._config.margin_m / self._cell_m)
        grid = Patch(bounding_window(patch.window for patch in self._patches).padded(margin))
        known = grid.window.intersection(self._base.window)
        grid.cells(known)[:] = self._base.cells(known)
        for patch in self._patches[self._in_base :]:
            grid.add(patch, patch.window)
        return OccupancyGrid(
            grid.evidence, self._cell_m, (grid.window.column * self._cell_m, grid.window.row * self._cell_m)
        )


def _reach_m(hits: Points, range_m: float) -> tuple[float, float]:
    """Root mean square and maximum distance (m) of points from base_link; beyond `range_m` they count as that far."""
    far_m = np.minimum(np.hypot(hits[:, 0], hits[:, 1]), range_m)
    far_m = far_m[np.isfinite(far_m)]
    return (math.sqrt(float(np.mean(far_m**2))), float(far_m.max())) if len(far_m) else (0.0, 0.0)
