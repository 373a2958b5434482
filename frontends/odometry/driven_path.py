"""The path driven by odometry: increments joined, and the motion between any two moments of it."""

import math
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.measurements import NANOSECOND_S, SECOND_NS
from wayfi.frontends.odometry.odometry_config import OdometryConfig

LONGEST_S = 3600.0  # of a motion: clocks that are set leave gaps of years, and a gyroscope's bias grows with time


@dataclass(frozen=True, slots=True)
class PathPoint:
    """One odometry pose on the driven path: `T_path_base` joins increments, free of jumps; `path_m` only grows.

    `discontinuities` counts the restarts of the odometry of which the motion is unknown.
    """

    stamp_ns: int
    T_path_base: Pose2
    path_m: float
    discontinuities: int = 0

    def motion_to(self, later: "PathPoint") -> WheelMotion:
        """The wheels' motion from here to `later`."""
        seconds = min((later.stamp_ns - self.stamp_ns) * NANOSECOND_S, LONGEST_S)
        pose, path_m = self.T_path_base.between(later.T_path_base), later.path_m - self.path_m
        return WheelMotion(pose, path_m, seconds, later.discontinuities - self.discontinuities)


class DrivenPath:
    """The recent path by odometry. Poses jump when a robot's base restarts; such a step counts as no motion.

    `leapt_m` is the length of the newest step if it was such a leap, else 0.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._points: deque[PathPoint] = deque()
        self._raw: Pose2 | None = None
        self._was_away = False
        self.leapt_m = 0.0

    @property
    def latest(self) -> PathPoint | None:
        """The newest point, None before the first odometry."""
        return self._points[-1] if self._points else None

    def restart(self) -> None:
        """Join the next pose without motion: the source of the odometry has changed."""
        self._raw = None

    def go_on(self) -> None:
        """Odometry may be missing before the next pose: if it restarted, the robot may have been moved meanwhile."""
        self._was_away = True

    def tip(self) -> "DrivenPath":
        """A copy that holds the newest point alone."""
        copy = DrivenPath(self._config)
        copy._points.extend(list(self._points)[-1:])
        copy._raw, copy._was_away = self._raw, self._was_away
        return copy

    def advance(self, stamp_ns: int, T_odom_base: Pose2) -> bool:
        """Add a pose; False if the step was not plausible and was taken as no motion."""
        last = self.latest
        plausible, discontinuities = True, last.discontinuities if last else 0
        if last is None:
            point, self.leapt_m = PathPoint(stamp_ns, T_odom_base, 0.0), 0.0
        else:
            step = Pose2() if self._raw is None else self._raw.between(T_odom_base)
            distance = math.hypot(step.x, step.y)
            seconds = (stamp_ns - last.stamp_ns) * NANOSECOND_S
            restarted = self._has_restarted(T_odom_base)
            self.leapt_m = 0.0
            if (self._was_away and restarted) or not distance <= max(
                self._config.min_leap_m, self._config.max_speed_m_s * seconds
            ):
                plausible, self.leapt_m, step, distance = False, distance, Pose2(), 0.0
                discontinuities += self._was_away or not restarted or seconds > self._config.restart_s
            point = PathPoint(stamp_ns, last.T_path_base @ step, last.path_m + distance, discontinuities)
        self._raw, self._was_away = T_odom_base, False
        self._points.append(point)
        kept_ns = int(self._config.path_s * SECOND_NS)
        while self._points[0].stamp_ns < stamp_ns - kept_ns and len(self._points) > 2:
            self._points.popleft()
        return plausible

    def lengths_at(self, stamps_ns: NDArray[np.int64]) -> Floats:
        """(n,) m of the path driven up to each of the moments (n,); NaN where they lie outside of what is kept."""
        known_ns = np.array([point.stamp_ns for point in self._points], np.int64)
        path_m = np.array([point.path_m for point in self._points])
        if len(known_ns) == 0:
            return np.full(len(stamps_ns), np.nan)
        after = np.searchsorted(known_ns, stamps_ns)
        inside = (after < len(known_ns)) & (stamps_ns >= known_ns[0])
        after = np.where(inside, after, 0)
        before = np.maximum(after - 1, 0)
        fraction = (stamps_ns - known_ns[before]) / np.maximum(known_ns[after] - known_ns[before], 1)
        lengths: Floats = np.where(inside, path_m[before] + fraction * (path_m[after] - path_m[before]), np.nan)
        return lengths

    def _has_restarted(self, T_odom_base: Pose2) -> bool:
        """Whether a pose is near the origin of the odometry, and the last one was not."""
        if self._raw is None:
            return False
        before_m, now_m = math.hypot(self._raw.x, self._raw.y), math.hypot(T_odom_base.x, T_odom_base.y)
        return now_m < self._config.restart_m < 0.5 * before_m

    def at(self, stamp_ns: int) -> PathPoint | None:
        """The path at a moment, interpolated; None where it lies outside of what is kept."""
        points = self._points
        if not points or not points[0].stamp_ns <= stamp_ns <= points[-1].stamp_ns:
            return None
        i = bisect_left(points, stamp_ns, key=lambda p: p.stamp_ns)
        after = points[i]
        if after.stamp_ns == stamp_ns:
            return after
        before = points[i - 1]
        fraction = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
        pose = before.T_path_base.interpolate(after.T_path_base, fraction)
        path_m = before.path_m + fraction * (after.path_m - before.path_m)
        return PathPoint(stamp_ns, pose, path_m, before.discontinuities)
