"""Scans at poses -> occupancy grid, submap by submap: what a correction moved is drawn anew, the rest is kept.

Some keyframes in a row are a submap; its scans are drawn into a patch of cells of the map, at their present poses.
Patches weigh in one after the other, in the order of the drive, so that what was seen last wins.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.grid.drawing import Floats, GridScan, Points, draw_patch
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.grid.patch import NOWHERE, CellWindow, Patch, around
from wayfi.backend.options import option
from wayfi.backend.pose2 import wrap_all

SUBMAP_KEYFRAMES = 20
MOVED_CELLS = 0.8  # by which the rays of a scan end elsewhere where its submap is drawn anew; less is not seen
REDRAWN_AT_ONCE = 5  # submaps that moved: 100 scans, 20 ms
REDRAW_KEYFRAMES = 10  # between two redraws, at least: 5 m
CELLS_A_KEYFRAME = 100_000  # of map, or ten times as many weighed in: so much of a redraw a keyframe pays for
SLACK = 200  # cells to grow into


@dataclass(frozen=True, slots=True)
class MapConfig:
    """How the occupancy grid is drawn and written."""

    resolution_m: float = option(0.05, "m", "Nav2's and slam_toolbox's default; a door frame is two cells")
    max_range_m: float = option(30.0, "m", "a UST-20LX's reach; beyond it a beam is wider than two cells")
    occupied_probability: float = option(0.65, "", "Nav2's occupied_thresh; one hit more than passes deny")
    free_probability: float = option(0.25, "", "Nav2's free_thresh; three passes")
    margin_m: float = option(1.0, "m", "unknown cells around what was seen, so that a planner sees the map's end")
    max_cells: int = option(30_000_000, "cells", "30 MB, and as much again to draw; 270 x 270 m at 5 cm, then coarser")


class GridMap:
    """The grid of a drive: give it each keyframe's scan, and redraw it at the poses of the moment."""

    def __init__(self, config: MapConfig) -> None:
        self._config = config
        self._cell_m = config.resolution_m
        self._scans: list[GridScan] = []
        self._patches: list[Patch] = []
        self._drawn = np.full((64, 3), np.nan)  # the pose at which each scan is drawn
        self._reach_m = np.zeros((64, 2))  # how far from base_link the rays of each scan end: root mean square, at most
        self._base = Patch(NOWHERE)  # all full submaps, weighed in
        self._in_base = 0
        self._fresh, self._due_after = 0, REDRAW_KEYFRAMES

    def add(self, hits: Points, sensor_xy_m: tuple[float, float] = (0.0, 0.0)) -> None:
        """The scan of the next keyframe: `hits` (m, 2) m in base_link, none where it has no scan; see GridScan."""
        number = len(self._scans)
        if number == len(self._drawn):
            self._drawn, self._reach_m = (np.resize(a, (2 * number, a.shape[1])) for a in (self._drawn, self._reach_m))
        if number % SUBMAP_KEYFRAMES == 0:
            self._patches.append(Patch(NOWHERE))
        self._scans.append(GridScan(hits, sensor_xy_m))
        self._drawn[number] = np.nan
        self._reach_m[number] = _reach_m(hits, self._config.max_range_m + math.hypot(*sensor_xy_m))
        self._fresh += len(hits) > 0

    @property
    def due(self) -> bool:
        """Whether enough keyframes with scans have come since the last redraw: the larger the map, the more."""
        return self._fresh >= self._due_after

    def redraw(self, poses: Floats) -> OccupancyGrid:
        """The grid at `poses` (n, 3), T_map_base of all keyframes, as far as a bounded number of scans brings it.

        What is new is drawn, then the submaps that moved furthest; the others stay as they are until a later call.
        Raises ValueError where there are not as many poses as scans.
        """
        return self._redraw(poses, MOVED_CELLS * self._cell_m, REDRAWN_AT_ONCE + self._fresh // SUBMAP_KEYFRAMES)

    def settle(self, poses: Floats) -> OccupancyGrid:
        """The grid at exactly `poses` (n, 3), whatever was drawn before; small and unknown all over without scans.

        Raises ValueError where there are not as many poses as scans.
        """
        return self._redraw(poses, 0.0, len(self._patches))

    def _redraw(self, poses: Floats, tolerance_m: float, most: int) -> OccupancyGrid:
        if len(poses) != len(self._scans):
            raise ValueError(f"{len(poses)} poses of {len(self._scans)} scans")
        self._choose_resolution(poses)
        changed = [self._draw(number, poses) for number in self._stale(poses, tolerance_m)[:most]]
        weighed_in = self._weigh_in(around(changed))
        grid = self._grid()
        self._fresh = 0
        self._due_after = max(REDRAW_KEYFRAMES, (grid.evidence.size + weighed_in // 10) // CELLS_A_KEYFRAME)
        return grid

    def _choose_resolution(self, poses: Floats) -> None:
        """Cells twice as wide, until no more than `max_cells` are needed; all is drawn anew where that changes."""
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
            self._patches = [Patch(NOWHERE) for _ in self._patches]
            self._drawn[:] = np.nan
            self._base, self._in_base = Patch(NOWHERE), 0

    def _stale(self, poses: Floats, tolerance_m: float) -> NDArray[np.int64]:
        """The submaps with a scan whose rays end more than `tolerance_m` off where they are drawn, furthest first."""
        if len(poses) == 0:
            return np.empty(0, np.int64)
        off = poses - self._drawn[: len(poses)]
        reach_m = self._reach_m[: len(poses), 0]
        shift_m = np.hypot(off[:, 0], off[:, 1]) + np.abs(wrap_all(off[:, 2])) * reach_m
        shift_m = np.where(reach_m > 0, np.nan_to_num(shift_m, nan=np.inf), 0.0)
        furthest_m = np.maximum.reduceat(shift_m, np.arange(0, len(poses), SUBMAP_KEYFRAMES))
        return np.argsort(-furthest_m, kind="stable")[: np.count_nonzero(furthest_m > tolerance_m)]

    def _draw(self, number: int, poses: Floats) -> CellWindow:
        """Draw a submap; returns the cells around what that changes in the base."""
        first = number * SUBMAP_KEYFRAMES
        members = slice(first, min(first + SUBMAP_KEYFRAMES, len(poses)))
        before = self._patches[number].window
        self._patches[number] = draw_patch(self._scans[members], poses[members], self._cell_m, self._config.max_range_m)
        self._drawn[members] = poses[members]
        return around([before, self._patches[number].window]) if number < self._in_base else NOWHERE

    def _weigh_in(self, changed: CellWindow) -> int:
        """Bring the base up to date in `changed`, and with the submaps filled since; returns the cells it took."""
        self._base = self._base.covering(changed, SLACK)
        self._base.cells(changed)[:] = 0
        taken = sum(self._base.add(patch, changed) for patch in self._patches[: self._in_base])
        full = len(self._scans) // SUBMAP_KEYFRAMES
        for patch in self._patches[self._in_base : full]:
            self._base = self._base.covering(patch.window, SLACK)
            taken += self._base.add(patch, patch.window)
        self._in_base = full
        return taken

    def _grid(self) -> OccupancyGrid:
        """All that is drawn, the submap still open on top, and a margin."""
        margin = math.ceil(self._config.margin_m / self._cell_m)
        grid = Patch(around(patch.window for patch in self._patches).grown(margin))
        known = grid.window.overlap(self._base.window)
        grid.cells(known)[:] = self._base.cells(known)
        for patch in self._patches[self._in_base :]:
            grid.add(patch, patch.window)
        return OccupancyGrid(
            grid.evidence, self._cell_m, (grid.window.column * self._cell_m, grid.window.row * self._cell_m)
        )


def _reach_m(hits: Points, range_m: float) -> tuple[float, float]:
    """How far from base_link points are, as a root mean square and at most, those beyond `range_m` cut to it."""
    far_m = np.minimum(np.hypot(hits[:, 0], hits[:, 1]), range_m)
    far_m = far_m[np.isfinite(far_m)]
    return (math.sqrt(float(np.mean(far_m**2))), float(far_m.max())) if len(far_m) else (0.0, 0.0)
