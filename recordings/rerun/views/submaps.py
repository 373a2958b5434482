"""Keyframes and their scans, grouped into submaps. A submap has the frame of its first keyframe, its anchor.

A correction of the graph moves the frames; scans and paths are redrawn only where keyframes moved within their submap.
"""

from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, between_all, wrap_all
from wayfi.frontends.events import GraphUpdated, KeyframeAdded
from wayfi.recordings.rerun import arrows
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.stream import RerunStream, downsampled, transform
from wayfi.recordings.rerun.style import ESTIMATE, KEYFRAME_SCAN, screen_radius
from wayfi.recordings.rerun.views.poses import Poses
from wayfi.recordings.rerun.views.view import Handlers

MOVE_M, MOVE_RAD = 0.02, float(np.deg2rad(0.2))  # smaller motions of a frame are not visible
REDRAW_M, REDRAW_RAD = 0.06, float(np.deg2rad(0.6))  # larger, because redrawing costs more than moving
CELL_M = 0.1

Points = NDArray[np.float32]


@dataclass
class _Submap:
    """A submap: `points` (n, 2) m, each in base_link of its keyframe `keyframe_of` (n,), and their grid `cells`."""

    first: int
    root: str
    points: Points = field(default_factory=lambda: np.zeros((0, 2), np.float32))
    keyframe_of: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    cells: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))


class SubmapsView:
    """Draws `/map/submaps/NNNN`: a frame, and below it the path and the scans of its keyframes."""

    def __init__(self, stream: RerunStream, config: RerunConfig, poses: Poses) -> None:
        self._stream = stream
        self._size = config.submap_keyframes
        self._scan_points = config.scan_points
        self._poses = poses
        self._submaps: list[_Submap] = []
        self._drawn_T_map_anchor = Poses()
        self._drawn_T_anchor_base = Poses()

    def handlers(self) -> Handlers:
        """The method that draws each kind of event."""
        return {KeyframeAdded: self.on_keyframe, GraphUpdated: self.on_graph}

    def on_keyframe(self, event: KeyframeAdded) -> None:
        """Add the keyframe and its scan to its submap."""
        self._add_submaps_up_to(len(self._poses))
        submap = self._submaps[event.keyframe // self._size]
        self._add_points(submap, event)
        self._draw(submap)

    def on_graph(self, event: GraphUpdated) -> None:
        """Move the frames that a correction moved, and redraw the submaps that it deformed."""
        if event.poses is None:
            return
        self._add_submaps_up_to(len(self._poses))
        anchors = self._poses.array()[:: self._size]
        for i in np.flatnonzero(_differs(self._drawn_T_map_anchor.array(), anchors, MOVE_M, MOVE_RAD)):
            self._move(int(i))
        deformed = _differs(self._drawn_T_anchor_base.array(), self._poses_in_submaps(), REDRAW_M, REDRAW_RAD)
        for i in np.unique(np.flatnonzero(deformed) // self._size):
            self._draw(self._submaps[i])

    def _add_submaps_up_to(self, keyframes: int) -> None:
        for first in range(len(self._submaps) * self._size, keyframes, self._size):
            submap = _Submap(first, f"/map/submaps/{len(self._submaps):04d}")
            self._submaps.append(submap)
            self._log_style(submap)
            self._move(len(self._submaps) - 1)
        for number in range(len(self._drawn_T_anchor_base), keyframes):
            self._drawn_T_anchor_base.put(number, Pose2(np.inf))

    def _log_style(self, submap: _Submap) -> None:
        self._stream.log_static(
            f"{submap.root}/path",
            rr.LineStrips2D.from_fields(colors=[ESTIMATE], radii=[screen_radius(1.2)], draw_order=10.0),
            rr.Points2D.from_fields(colors=[ESTIMATE], radii=[screen_radius(2.0)], draw_order=11.0),
        )
        points = rr.Points2D.from_fields(colors=[KEYFRAME_SCAN], radii=[screen_radius(0.8)], draw_order=0.0)
        self._stream.log_static(f"{submap.root}/scans", points)

    def _move(self, i: int) -> None:
        T_map_anchor = self._poses.pose(self._submaps[i].first)
        self._drawn_T_map_anchor.put(i, T_map_anchor)
        self._stream.log(self._submaps[i].root, transform(T_map_anchor))

    def _add_points(self, submap: _Submap, event: KeyframeAdded) -> None:
        """Add the points of the scan in cells where the submap has no points yet."""
        scan = downsampled(event.points, self._scan_points)
        T_anchor_base = self._poses.pose(submap.first).between(event.T_map_base)
        grid = np.floor(T_anchor_base.transform(scan.astype(np.float64)) / CELL_M).astype(np.int64)
        cells, index = np.unique(grid[:, 0] * (1 << 32) + grid[:, 1], return_index=True)
        new = ~np.isin(cells, submap.cells, assume_unique=True)
        added = scan[index[new]]
        submap.cells = np.concatenate([submap.cells, cells[new]])
        submap.points = np.concatenate([submap.points, added])
        submap.keyframe_of = np.concatenate([submap.keyframe_of, np.full(len(added), event.keyframe)])

    def _poses_in_submaps(self) -> Floats:
        """(n, 3) T_anchor_base of every keyframe."""
        poses = self._poses.array()
        return between_all(np.repeat(poses[:: self._size], self._size, axis=0)[: len(poses)], poses)

    def _draw(self, submap: _Submap) -> None:
        before = min(submap.first, 1)  # the path starts at the last keyframe of the submap before
        poses = self._poses.array()[submap.first - before : submap.first + self._size]
        members = between_all(self._poses.array()[submap.first], poses)
        for number, row in enumerate(members[before:], submap.first):
            self._drawn_T_anchor_base.put(number, Pose2.of(row))
        path = members[:, :2].astype(np.float32)
        strip, dots = (
            rr.LineStrips2D.from_fields(strips=arrows.strips([path])),
            rr.Points2D.from_fields(positions=arrows.points(path[before:])),
        )
        self._stream.log(f"{submap.root}/path", strip, dots)
        if len(submap.points):
            points = _transformed(members[submap.keyframe_of - submap.first + before], submap.points)
            self._stream.log(f"{submap.root}/scans", rr.Points2D.from_fields(positions=arrows.points(points)))


def _transformed(T: Floats, points: Points) -> Points:
    """(n, 2) points, each transformed by its row of `T` (n, 3)."""
    c, s = np.cos(T[:, 2]), np.sin(T[:, 2])
    x, y = points[:, 0], points[:, 1]
    return np.stack([T[:, 0] + c * x - s * y, T[:, 1] + s * x + c * y], axis=1).astype(np.float32)


def _differs(a: Floats, b: Floats, bound_m: float, bound_rad: float) -> NDArray[np.bool_]:
    """(n,) whether the poses `a` and `b` (n, 3) differ by more than either bound."""
    distance_m = np.hypot(a[:, 0] - b[:, 0], a[:, 1] - b[:, 1])
    return (distance_m > bound_m) | (np.abs(wrap_all(a[:, 2] - b[:, 2])) > bound_rad)
