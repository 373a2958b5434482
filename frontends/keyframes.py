"""The keyframes: when one is due, where each stands on the driven path, and the scan it holds."""

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, between_all
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.scan_points import ScanPoints


@dataclass(frozen=True, slots=True, eq=False)
class Keyframe:
    """A base pose kept in the graph. `scan` is None where there is no laser, or none of its beams returned."""

    point: PathPoint
    scan: ScanPoints | None


class Keyframes:
    """Keyframes 0, 1, ... in the order of the graph."""

    def __init__(self) -> None:
        self._keyframes: list[Keyframe] = []
        self._paths = np.empty(64)
        self._has_scan = np.zeros(64, np.bool_)
        self._pieces = [0]
        self._unknown_m = 0.0

    def __len__(self) -> int:
        return len(self._keyframes)

    def __getitem__(self, number: int) -> Keyframe:
        return self._keyframes[number]

    def __iter__(self) -> Iterator[Keyframe]:
        return iter(self._keyframes)

    @property
    def newest(self) -> Keyframe:
        """The newest keyframe. Raises IndexError before the first."""
        return self._keyframes[-1]

    def append(self, keyframe: Keyframe) -> None:
        """Add the next keyframe."""
        if len(self) == len(self._paths):
            self._paths = np.resize(self._paths, 2 * len(self._paths))
            self._has_scan = np.resize(self._has_scan, len(self._paths))
        self._paths[len(self)] = keyframe.point.path_m + self._unknown_m
        self._has_scan[len(self)] = keyframe.scan is not None
        self._keyframes.append(keyframe)

    def begin_piece(self, path_m: float) -> None:
        """The robot was moved by an unknown way to the next keyframe, which counts as `path_m` more of path."""
        self._pieces.append(len(self))
        self._unknown_m += path_m

    @property
    def moved_to(self) -> list[int]:
        """The keyframes that begin a piece, but for the first."""
        return self._pieces[1:]

    def piece(self, number: int) -> tuple[int, int]:
        """First and last (excluded) of the keyframes around `number` whose relative poses are known."""
        following = bisect_right(self._pieces, number)
        last = self._pieces[following] if following < len(self._pieces) else len(self)
        return self._pieces[following - 1], last

    def move(self, number: int, point: PathPoint) -> None:
        """Give keyframe `number` another place on the driven path."""
        before_m = self[number].point.path_m
        self._keyframes[number] = replace(self[number], point=point)
        self._paths[number] += point.path_m - before_m

    def forget_oldest(self, count: int) -> None:
        """Drop the oldest `count` keyframes, fewer than there are; the others are numbered from 0 again."""
        self._keyframes = self._keyframes[count:]
        self._paths, self._has_scan = self._paths[count:], self._has_scan[count:]
        self._pieces = [0, *(piece - count for piece in self._pieces if piece > count)]

    def forget_scans(self) -> None:
        """Remove the scans of all keyframes."""
        self._keyframes = [Keyframe(keyframe.point, None) for keyframe in self._keyframes]
        self._has_scan[:] = False

    def before(self, stamp_ns: int) -> int:
        """The newest keyframe that is no later than `stamp_ns`, which is recent; the first where none is."""
        number = len(self) - 1
        while number > 0 and self[number].point.stamp_ns > stamp_ns:
            number -= 1
        return number

    @property
    def paths_m(self) -> Floats:
        """(n,) the path up to each keyframe, m: driven, and what `begin_piece` adds to it."""
        return self._paths[: len(self)]

    @property
    def has_scan(self) -> NDArray[np.bool_]:
        """(n,) whether each keyframe holds a scan."""
        return self._has_scan[: len(self)]

    def scans_around(self, first: int, last: int, origin: Floats, poses: Floats) -> tuple[list[ScanPoints], Floats]:
        """Scans of keyframes first..last (excluded), and their (n, 3) poses in the frame at `origin`."""
        numbers = [k for k in range(max(first, 0), min(last, len(self))) if self[k].scan is not None]
        scans = [scan for k in numbers if (scan := self[k].scan) is not None]
        placed = between_all(origin, poses[numbers]) if numbers else np.empty((0, 3))
        return scans, placed


def keyframe_due(motion: WheelMotion, config: OdometryConfig, factor: float = 1.0) -> bool:
    """Whether a new keyframe is due after `motion` since the last one; `factor` multiplies the limits."""
    if motion.discontinuities:
        return True
    turned = abs(motion.pose.theta)
    if motion.path_m >= factor * config.keyframe_distance_m or turned >= factor * config.keyframe_turn_rad:
        return True
    moved = motion.path_m > config.keyframe_still_m or turned > config.keyframe_still_rad
    return moved and motion.seconds >= factor * config.keyframe_seconds
