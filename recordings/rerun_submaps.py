"""Keyframes and their scans on frames that a correction moves: ten keyframes hang on the frame of the first."""

from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from wayfi.backend.pose2 import Floats, Pose2, between_all, wrap_all
from wayfi.frontends.events import GraphUpdated, KeyframeAdded
from wayfi.recordings.rerun_config import RerunConfig
from wayfi.recordings.rerun_poses import KeyframePoses
from wayfi.recordings.rerun_stream import Stream, frame, thinned
from wayfi.recordings.rerun_style import ESTIMATE, KEYFRAME_SCAN, ui

MOVED_M, MOVED_RAD = 0.02, np.deg2rad(0.2)  # less than this is not seen in a map of rooms
BENT_M, BENT_RAD = 0.06, np.deg2rad(0.6)  # a submap is drawn anew: dearer than moving it, so later
CELL_M = 0.1


@dataclass
class _Submap:
    """What hangs on one frame; `T_anchor_base` holds the predecessor first, as they were drawn."""

    first: int
    root: str
    points: dict[int, NDArray[np.float32]] = field(default_factory=dict)
    cells: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    T_anchor_base: Floats = field(default_factory=lambda: np.zeros((0, 3)))


class Submaps:
    """Draws `/map/submaps/NNNN`: a frame, the path and the scans of its keyframes below it."""

    def __init__(self, stream: Stream, config: RerunConfig, poses: KeyframePoses) -> None:
        self._stream = stream
        self._config = config
        self._poses = poses
        self._submaps: list[_Submap] = []
        self._drawn_anchors = np.zeros((0, 3))

    def on_keyframe(self, event: KeyframeAdded) -> None:
        """The keyframe and its scan join the newest submap."""
        self._open_up_to(len(self._poses))
        submap = self._submaps[event.keyframe // self._config.submap_keyframes]
        self._take(submap, event)
        self._draw(submap)

    def on_graph(self, event: GraphUpdated) -> None:
        """A correction moves the frames that moved, and redraws the few that were bent."""
        if event.poses is None:
            return
        self._open_up_to(len(self._poses))
        anchors = self._poses.array()[:: self._config.submap_keyframes]
        for i in np.flatnonzero(_differ(self._drawn_anchors, anchors, MOVED_M, MOVED_RAD)):
            self._move(int(i), Pose2.of(anchors[i]))
        for submap in self._submaps:
            now = self._members(submap)
            if len(now) != len(submap.T_anchor_base) or _differ(submap.T_anchor_base, now, BENT_M, BENT_RAD).any():
                self._draw(submap)

    def _open_up_to(self, keyframes: int) -> None:
        size = self._config.submap_keyframes
        for first in range(len(self._submaps) * size, keyframes, size):
            submap = _Submap(first, f"/map/submaps/{len(self._submaps):04d}")
            self._submaps.append(submap)
            self._drawn_anchors = np.vstack([self._drawn_anchors, np.full(3, np.nan)])
            self._style(submap)
            self._move(len(self._submaps) - 1, self._poses.pose(first))

    def _style(self, submap: _Submap) -> None:
        self._stream.style(
            f"{submap.root}/path",
            rr.LineStrips2D.from_fields(colors=[ESTIMATE], radii=[ui(1.2)], draw_order=10.0),
            rr.Points2D.from_fields(colors=[ESTIMATE], radii=[ui(2.0)], draw_order=11.0),
        )
        points = rr.Points2D.from_fields(colors=[KEYFRAME_SCAN], radii=[ui(0.8)], draw_order=0.0)
        self._stream.style(f"{submap.root}/scans", points)

    def _move(self, i: int, T_map_anchor: Pose2) -> None:
        self._drawn_anchors[i] = T_map_anchor.array()
        self._stream.log(self._submaps[i].root, frame(T_map_anchor))

    def _take(self, submap: _Submap, event: KeyframeAdded) -> None:
        """Keep those points of the scan that fall on cells where the submap has none yet."""
        scan = thinned(event.points, self._config.scan_points)
        T_anchor_base = self._poses.pose(submap.first).between(event.T_map_base)
        grid = np.floor(T_anchor_base.transform(scan.astype(np.float64)) / CELL_M).astype(np.int64)
        cells, index = np.unique(grid[:, 0] * (1 << 32) + grid[:, 1], return_index=True)
        fresh = ~np.isin(cells, submap.cells, assume_unique=True)
        submap.cells = np.concatenate([submap.cells, cells[fresh]])
        submap.points[event.keyframe] = scan[index[fresh]]

    def _members(self, submap: _Submap) -> Floats:
        poses = self._poses.array()
        members = poses[max(submap.first - 1, 0) : submap.first + self._config.submap_keyframes]
        return between_all(poses[submap.first], members)

    def _draw(self, submap: _Submap) -> None:
        members = self._members(submap)
        submap.T_anchor_base = members
        keyframes = np.arange(len(members)) + max(submap.first - 1, 0)
        path = members[:, :2].astype(np.float32)
        own = path[keyframes >= submap.first]
        parts = (rr.LineStrips2D.from_fields(strips=[path]), rr.Points2D.from_fields(positions=own))
        self._stream.log(f"{submap.root}/path", *parts)
        T_of = {int(k): Pose2.of(row) for k, row in zip(keyframes, members, strict=True)}
        clouds = [T_of[k].transform(points.astype(np.float64)) for k, points in submap.points.items()]
        if clouds:
            points = np.concatenate(clouds).astype(np.float32)
            self._stream.log(f"{submap.root}/scans", rr.Points2D.from_fields(positions=points))


def _differ(a: Floats, b: Floats, far_m: float, far_rad: float) -> NDArray[np.bool_]:
    """Which of the (n, 3) poses differ by more than either bound; NaN differs."""
    apart = np.hypot(a[:, 0] - b[:, 0], a[:, 1] - b[:, 1])
    turned = np.abs(wrap_all(a[:, 2] - b[:, 2]))
    return ~((apart <= far_m) & (turned <= far_rad))
