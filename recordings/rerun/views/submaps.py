"""Keyframes and their scans on frames that a correction moves: some keyframes hang on the frame of the first."""

from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, between_all, wrap_all
from wayfi.frontends.events import GraphUpdated, KeyframeAdded
from wayfi.recordings.rerun import arrows
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.stream import Stream, frame, thinned
from wayfi.recordings.rerun.style import ESTIMATE, KEYFRAME_SCAN, ui
from wayfi.recordings.rerun.views.poses import Poses

MOVED_M, MOVED_RAD = 0.02, float(np.deg2rad(0.2))  # less than this is not seen in a map of rooms
BENT_M, BENT_RAD = 0.06, float(np.deg2rad(0.6))  # a submap is drawn anew: dearer than moving it, so later
CELL_M = 0.1

Points = NDArray[np.float32]


@dataclass
class _Submap:
    """What hangs on one frame: `points` (n, 2) m, each in base_link of its keyframe `keyframe_of` (n,)."""

    first: int
    root: str
    points: Points = field(default_factory=lambda: np.zeros((0, 2), np.float32))
    keyframe_of: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    cells: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))


class SubmapsView:
    """Draws `/map/submaps/NNNN`: a frame, the path and the scans of its keyframes below it."""

    def __init__(self, stream: Stream, config: RerunConfig, poses: Poses) -> None:
        self._stream = stream
        self._size = config.submap_keyframes
        self._scan_points = config.scan_points
        self._poses = poses
        self._submaps: list[_Submap] = []
        self._drawn_T_map_anchor = Poses()
        self._drawn_T_anchor_base = Poses()

    def on_keyframe(self, event: KeyframeAdded) -> None:
        """The keyframe and its scan join the newest submap."""
        self._open_up_to(len(self._poses))
        submap = self._submaps[event.keyframe // self._size]
        self._take(submap, event)
        self._draw(submap)

    def on_graph(self, event: GraphUpdated) -> None:
        """A correction moves the frames that moved, and redraws the few that were bent."""
        if event.poses is None:
            return
        self._open_up_to(len(self._poses))
        anchors = self._poses.array()[:: self._size]
        for i in np.flatnonzero(_differ(self._drawn_T_map_anchor.array(), anchors, MOVED_M, MOVED_RAD)):
            self._move(int(i))
        bent = _differ(self._drawn_T_anchor_base.array(), self._relative(), BENT_M, BENT_RAD)
        for i in np.unique(np.flatnonzero(bent) // self._size):
            self._draw(self._submaps[i])

    def _open_up_to(self, keyframes: int) -> None:
        for first in range(len(self._submaps) * self._size, keyframes, self._size):
            submap = _Submap(first, f"/map/submaps/{len(self._submaps):04d}")
            self._submaps.append(submap)
            self._style(submap)
            self._move(len(self._submaps) - 1)
        for number in range(len(self._drawn_T_anchor_base), keyframes):
            self._drawn_T_anchor_base.put(number, Pose2(np.inf))

    def _style(self, submap: _Submap) -> None:
        self._stream.style(
            f"{submap.root}/path",
            rr.LineStrips2D.from_fields(colors=[ESTIMATE], radii=[ui(1.2)], draw_order=10.0),
            rr.Points2D.from_fields(colors=[ESTIMATE], radii=[ui(2.0)], draw_order=11.0),
        )
        points = rr.Points2D.from_fields(colors=[KEYFRAME_SCAN], radii=[ui(0.8)], draw_order=0.0)
        self._stream.style(f"{submap.root}/scans", points)

    def _move(self, i: int) -> None:
        T_map_anchor = self._poses.pose(self._submaps[i].first)
        self._drawn_T_map_anchor.put(i, T_map_anchor)
        self._stream.log(self._submaps[i].root, frame(T_map_anchor))

    def _take(self, submap: _Submap, event: KeyframeAdded) -> None:
        """Keep those points of the scan that fall on cells where the submap has none yet."""
        scan = thinned(event.points, self._scan_points)
        T_anchor_base = self._poses.pose(submap.first).between(event.T_map_base)
        grid = np.floor(T_anchor_base.transform(scan.astype(np.float64)) / CELL_M).astype(np.int64)
        cells, index = np.unique(grid[:, 0] * (1 << 32) + grid[:, 1], return_index=True)
        fresh = ~np.isin(cells, submap.cells, assume_unique=True)
        kept = scan[index[fresh]]
        submap.cells = np.concatenate([submap.cells, cells[fresh]])
        submap.points = np.concatenate([submap.points, kept])
        submap.keyframe_of = np.concatenate([submap.keyframe_of, np.full(len(kept), event.keyframe)])

    def _relative(self) -> Floats:
        """(n, 3) of every keyframe, in the frame of its submap."""
        poses = self._poses.array()
        return between_all(np.repeat(poses[:: self._size], self._size, axis=0)[: len(poses)], poses)

    def _draw(self, submap: _Submap) -> None:
        before = min(submap.first, 1)  # the path starts at the keyframe before
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
            points = _placed(members[submap.keyframe_of - submap.first + before], submap.points)
            self._stream.log(f"{submap.root}/scans", rr.Points2D.from_fields(positions=arrows.points(points)))


def _placed(T: Floats, points: Points) -> Points:
    """(n, 2) points, each through its own row of the (n, 3) poses."""
    c, s = np.cos(T[:, 2]), np.sin(T[:, 2])
    x, y = points[:, 0], points[:, 1]
    return np.stack([T[:, 0] + c * x - s * y, T[:, 1] + s * x + c * y], axis=1).astype(np.float32)


def _differ(a: Floats, b: Floats, far_m: float, far_rad: float) -> NDArray[np.bool_]:
    """Which of the (n, 3) poses differ by more than either bound."""
    apart = np.hypot(a[:, 0] - b[:, 0], a[:, 1] - b[:, 1])
    return (apart > far_m) | (np.abs(wrap_all(a[:, 2] - b[:, 2])) > far_rad)
