"""The two trajectories of a drive: as it was published, and as it is estimated at the end."""

import math
from array import array
from bisect import bisect_left
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.wheel_calibration import corrected_all
from wayfi.backend.pose2 import Floats, Pose2, between_all, compose_all
from wayfi.frontends.measurements import NANOSECOND_S
from wayfi.frontends.odometry.driven_path import LONGEST_S, PathPoint

UNPUBLISHED = (math.nan, math.nan, math.nan)
STANDING_M = 1e-3  # of path between keyframes: less is the jitter of a robot that stands, and says nothing of the way


class Trajectories:
    """One entry for each accepted odometry message: its place on the path and the pose published for it."""

    def __init__(self) -> None:
        self._stamps = array("q")
        self._path = array("d")
        self._online = array("d")

    def __len__(self) -> int:
        return len(self._stamps)

    def add(self, point: PathPoint, published: Pose2 | None) -> None:
        """Add the next message; None where no pose was published for it."""
        T = point.T_path_base
        self._stamps.append(point.stamp_ns)
        self._path.extend((T.x, T.y, T.theta, point.path_m))
        self._online.extend((published.x, published.y, published.theta) if published else UNPUBLISHED)

    def publish_newest(self, T_map_base: Pose2) -> None:
        """A pose has been published for the newest message, which had none."""
        self._online[-3:] = array("d", (T_map_base.x, T_map_base.y, T_map_base.theta))

    def at(self, stamp_ns: int) -> PathPoint | None:
        """The driven path at a moment, however long ago; None outside of it."""
        after = bisect_left(self._stamps, stamp_ns)
        if not 0 < after < len(self):
            return None
        before_ns, after_ns = self._stamps[after - 1], self._stamps[after]
        fraction = (stamp_ns - before_ns) / (after_ns - before_ns)
        *earlier, earlier_m = self._path[4 * after - 4 : 4 * after]
        *later, later_m = self._path[4 * after : 4 * after + 4]
        pose = Pose2.of(earlier).interpolate(Pose2.of(later), fraction)
        return PathPoint(stamp_ns, pose, earlier_m + fraction * (later_m - earlier_m))

    def stamps_ns(self) -> NDArray[np.int64]:
        """(n,) stamps, strictly increasing."""
        return np.array(self._stamps, np.int64)

    def online(self) -> Floats:
        """(n, 3) poses of base_link in `map` as they were published, NaN where none was."""
        return np.array(self._online, np.float64).reshape(-1, 3)

    def final(
        self, keyframes: list[PathPoint], poses: Floats, calibration: Floats, moved_to: Sequence[int] = ()
    ) -> Floats:
        """(n, 3) poses given the keyframes' `poses` (m, 3): the wheels between them, bent to meet both ends.

        To the keyframes `moved_to` the robot was moved by an unknown way: up to them the wheels lead on unbent.
        """
        if not keyframes:
            return np.zeros((0, 3))
        stamps, path = self.stamps_ns(), np.array(self._path, np.float64).reshape(-1, 4)
        kf_stamps = np.array([k.stamp_ns for k in keyframes], np.int64)
        kf_path = np.array([(*k.T_path_base.array(), k.path_m) for k in keyframes])
        k = np.clip(np.searchsorted(kf_stamps, stamps, side="right") - 1, 0, len(keyframes) - 1)
        since_s: Floats = (stamps - kf_stamps[k]).astype(np.float64) * NANOSECOND_S
        driven = _motions(kf_path[k], path, since_s, calibration)
        between_s: Floats = np.diff(kf_stamps).astype(np.float64) * NANOSECOND_S
        whole = _motions(kf_path[:-1], kf_path[1:], between_s, calibration)
        missing = between_all(whole, between_all(poses[:-1], poses[1:])) if len(poses) > 1 else np.zeros((0, 3))
        missing = np.concatenate([missing, np.zeros((1, 3))])
        missing[np.array(moved_to, np.intp) - 1] = 0.0
        share = _share(path[:, 3], stamps, kf_path[:, 3], kf_stamps, k)
        return compose_all(compose_all(poses[k], driven), missing[k] * share[:, None])


def _motions(start: Floats, end: Floats, seconds: Floats, calibration: Floats) -> Floats:
    """(n, 3) motions from `start` to `end` (n, 4: x, y, theta, path), corrected by the calibration."""
    if len(end) == 0:
        return np.zeros((0, 3))
    raw = between_all(start[:, :3], end[:, :3])
    return corrected_all(np.column_stack([raw, end[:, 3] - start[:, 3], np.minimum(seconds, LONGEST_S)]), calibration)


def _share(
    path: Floats, stamps: NDArray[np.int64], kf_path: Floats, kf_stamps: NDArray[np.int64], k: NDArray[np.int64]
) -> Floats:
    """(n,) how much of the way from keyframe k to the next is done, 0 to 1: by path, by time where there is none."""
    following = np.minimum(k + 1, len(kf_path) - 1)
    length = kf_path[following] - kf_path[k]
    seconds = np.maximum((kf_stamps[following] - kf_stamps[k]) * NANOSECOND_S, NANOSECOND_S)
    by_time = (stamps - kf_stamps[k]) * NANOSECOND_S / seconds
    by_path = (path - kf_path[k]) / np.maximum(length, STANDING_M)
    return np.clip(np.where(length > STANDING_M, by_path, by_time), 0.0, 1.0)
