"""The path driven by odometry: increments joined, and the motion between any two moments of it."""

import math
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2, wrap, wrap_all
from wayfi.frontends.measurements import NANOSECOND_S, SECOND_NS
from wayfi.frontends.odometry.odometry_config import OdometryConfig

ORIGIN_M, ORIGIN_RAD = 0.1, 0.1  # of a step to the very origin, where sums of steps do not lead again: a restart
ROUNDING = 1e-6  # m and rad
LONGEST_S = 3600.0  # of a motion: clocks that are set leave gaps of years, and a gyroscope's bias grows with time


class LedStep(NamedTuple):
    """What a laser that leads knows of a step: the variance `open_m2` of the place that walls leave open.

    Where the sweep does not fit (`fits`) the step may be any; and where the laser was silent for long before (`blind`)
    even one that fits.
    """

    open_m2: float = 0.0
    fits: bool = True
    blind: bool = False


class PathPoint(NamedTuple):
    """One odometry pose on the driven path: `T_path_base` joins increments, free of jumps; `path_m` only grows.

    `discontinuities` counts the restarts of the odometry of which the motion is unknown. `led_s`, `open_m2`, `blind_s`
    only grow too: by the time of steps that the laser led, the variance of what the walls left open of them, and the
    time of those that are `blind`.
    """

    stamp_ns: int
    T_path_base: Pose2
    path_m: float
    discontinuities: int = 0
    open_m2: float = 0.0
    led_s: float = 0.0
    blind_s: float = 0.0

    def motion_to(self, later: "PathPoint") -> WheelMotion:
        """The wheels' motion from here to `later`."""
        seconds = min((later.stamp_ns - self.stamp_ns) * NANOSECOND_S, LONGEST_S)
        pose, path_m = self.T_path_base.between(later.T_path_base), later.path_m - self.path_m
        discontinuities, open_m2 = later.discontinuities - self.discontinuities, later.open_m2 - self.open_m2
        return WheelMotion(pose, path_m, seconds, discontinuities, open_m2, later.blind_s - self.blind_s)


@dataclass(frozen=True, slots=True)
class _SetAside:
    """The newest point by wheels that fell silent, the pose that they gave there, and how fast they had been, m/s."""

    point: PathPoint
    raw: Pose2
    fastest_m_s: float


class DrivenPath:
    """The recent path by odometry. Poses jump when a robot's base restarts; such a step counts as no motion.

    `leapt_m` and `leapt_rad` are the length and the turn of the newest step if it was such a leap, else 0.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._points: deque[PathPoint] = deque()
        self._raw: Pose2 | None = None
        self._restarts = self._was_away = False
        self._aside: _SetAside | None = None
        self._regains = False
        self.leapt_m = self.leapt_rad = 0.0

    @property
    def latest(self) -> PathPoint | None:
        """The newest point, None before the first odometry."""
        return self._points[-1] if self._points else None

    @property
    def leap_text(self) -> str:
        """What is to be told of the newest step, which was such a leap."""
        if self.leapt_m > self._config.min_leap_m:
            return "the odometry leapt further than a robot drives; the leap counts as no motion"
        return "the odometry began anew or turned further than a robot turns; the leap counts as no motion"

    def restart(self) -> None:
        """Join the next pose without motion: the source of the odometry has changed."""
        self._raw, self._restarts, self._regains = None, True, False

    def set_aside(self) -> None:
        """The wheels fell silent: join the next pose, of what leads in their place, without motion."""
        last = self.latest
        self._aside = _SetAside(last, self._raw, self._fastest_m_s(last)) if last and self._raw else None
        self.restart()

    def take_up(self) -> None:
        """The wheels are back: the next pose tells the motion since `set_aside`, for they counted meanwhile."""
        self.restart()
        self._regains = self._aside is not None

    def forget_aside(self) -> None:
        """The next pose of the wheels says nothing of the motion since `set_aside`: it is by another count."""
        self._aside = None

    def rejoin(self, T_odom_base: Pose2) -> None:
        """Join the next pose by the motion since this one, which the new source gave for the path's end or before."""
        if self._restarts and not self._regains:
            self._raw = T_odom_base

    def go_on(self) -> None:
        """Odometry may be missing before the next pose: if it restarted, the robot may have been moved meanwhile."""
        self._was_away = True

    def tip(self) -> "DrivenPath":
        """A copy that holds the newest point alone."""
        copy = DrivenPath(self._config)
        copy._points.extend(list(self._points)[-1:])
        copy._raw, copy._restarts, copy._was_away = self._raw, self._restarts, self._was_away
        copy._aside, copy._regains = self._aside, self._regains
        return copy

    def advance(self, stamp_ns: int, T_odom_base: Pose2, led: LedStep | None = None) -> bool:
        """Add a pose, of the wheels or `led` by the laser; False if the step was not plausible and counts as none."""
        if self._regains:
            self._regain(stamp_ns, T_odom_base)
        last = self.latest
        plausible, discontinuities = True, last.discontinuities if last else 0
        self.leapt_m = self.leapt_rad = 0.0
        if last is None:
            point = PathPoint(stamp_ns, T_odom_base, 0.0)
        else:
            step = Pose2() if self._raw is None else self._raw.between(T_odom_base)
            seconds = (stamp_ns - last.stamp_ns) * NANOSECOND_S
            restarted = self._has_restarted(T_odom_base)
            if (self._was_away and restarted) or self._leaps(step, T_odom_base, seconds):
                self.leapt_m, self.leapt_rad = math.hypot(step.x, step.y), abs(step.theta)
                plausible, step = False, Pose2()
                discontinuities += self._was_away or not restarted or seconds > self._config.restart_s
            led_s, led = (seconds, led) if led else (0.0, LedStep())
            discontinuities += not led.fits or led.blind
            T_path_base, path_m = last.T_path_base @ step, last.path_m + math.hypot(step.x, step.y)
            grown = last.open_m2 + led.open_m2, last.led_s + led_s, last.blind_s + seconds * led.blind
            point = PathPoint(stamp_ns, T_path_base, path_m, discontinuities, *grown)
        self._raw, self._restarts, self._was_away = T_odom_base, False, False
        self._points.append(point)
        kept_ns = int(self._config.path_s * SECOND_NS)
        while self._points[0].stamp_ns < stamp_ns - kept_ns and len(self._points) > 2:
            self._points.popleft()
        return plausible

    def _regain(self, stamp_ns: int, T_odom_base: Pose2) -> None:
        """Move the path's end to where the wheels put it, which were silent and give `T_odom_base` now.

        Between two of their poses they are assumed to have turned evenly. The end stays where `_counted` denies.
        """
        aside, last = self._aside, self.latest
        self._aside, self._regains = None, False
        assert aside is not None
        assert last is not None
        motion = aside.raw.between(T_odom_base)
        if not self._counted(aside, motion, stamp_ns):
            return
        fraction = (last.stamp_ns + 1 - aside.point.stamp_ns) / (stamp_ns - aside.point.stamp_ns)
        since = Pose2().interpolate(motion, fraction)
        T_path_base = aside.point.T_path_base @ since
        path_m = last.path_m + last.T_path_base.distance(T_path_base)
        self._points.append(last._replace(stamp_ns=last.stamp_ns + 1, T_path_base=T_path_base, path_m=path_m))
        self._raw = aside.raw @ since

    def _counted(self, aside: _SetAside, motion: Pose2, stamp_ns: int) -> bool:
        """Whether wheels that were silent until `stamp_ns` counted on, so that their `motion` tells the way meanwhile.

        They did not if they moved further than they had ever, turned otherwise than what led meanwhile, or stood while
        that moved. Over a long silence what led knows more than they do.
        """
        config, last = self._config, self.latest
        assert last is not None
        seconds = (stamp_ns - aside.point.stamp_ns) * NANOSECOND_S
        led = aside.point.T_path_base.between(last.T_path_base)
        driven_m, led_m = math.hypot(motion.x, motion.y), math.hypot(led.x, led.y)
        if seconds > config.regain_s or abs(wrap(motion.theta - led.theta)) > config.regain_rad:
            return False
        stood = driven_m < config.keyframe_still_m < led_m
        return not stood and driven_m <= aside.fastest_m_s * seconds + config.min_leap_m

    def _fastest_m_s(self, last: PathPoint) -> float:
        """The longest way of a second, in the path that is kept."""
        seconds = np.arange(int(self._config.path_s))
        lengths = self.lengths_at(last.stamp_ns - seconds * SECOND_NS)
        return float(np.nanmax(-np.diff(lengths), initial=0.0))

    def newest_second(self) -> Pose2 | None:
        """The motion of the newest second; None where the path is shorter."""
        last = self.latest
        before = self.at(last.stamp_ns - SECOND_NS) if last else None
        return before.T_path_base.between(last.T_path_base) if before and last else None

    def lengths_at(self, stamps_ns: NDArray[np.int64]) -> Floats:
        """(n,) m of the path driven up to each of the moments (n,); NaN where they lie outside of what is kept."""
        if not self._points:
            return np.full(len(stamps_ns), np.nan)
        inside, before, after, fraction = self._around(stamps_ns)
        path_m = np.array([point.path_m for point in self._points])
        return np.where(inside, path_m[before] + fraction * (path_m[after] - path_m[before]), np.nan)

    def headings_at(self, stamps_ns: NDArray[np.int64]) -> Floats:
        """(n,) rad, the headings of `at` at each of the moments (n,), to the last bit; NaN where `at` has none."""
        if not self._points:
            return np.full(len(stamps_ns), np.nan)
        inside, before, after, fraction = self._around(stamps_ns)
        headings = np.array([point.T_path_base.theta for point in self._points])
        between = wrap_all(headings[before] + fraction * wrap_all(headings[after] - headings[before]))
        return np.where(inside, np.where(fraction == 1.0, headings[after], between), np.nan)

    def _around(
        self, stamps_ns: NDArray[np.int64]
    ) -> tuple[NDArray[np.bool_], NDArray[np.int64], NDArray[np.int64], Floats]:
        """Whether moments (n,) are in what is kept; the points before and after each, and its fraction of their way."""
        known_ns = np.array([point.stamp_ns for point in self._points], np.int64)
        after = np.searchsorted(known_ns, stamps_ns)
        inside = (after < len(known_ns)) & (stamps_ns >= known_ns[0])
        after = np.where(inside, after, 0)
        before = np.maximum(after - 1, 0)
        apart_ns = known_ns[after] - known_ns[before]
        fraction = np.where(apart_ns > 0, (stamps_ns - known_ns[before]) / np.maximum(apart_ns, 1), 1.0)
        return inside, before, after, fraction

    def _leaps(self, step: Pose2, T_odom_base: Pose2, seconds: float) -> bool:
        """Whether a step is further than a robot drives or turns, or leads to the very origin."""
        config = self._config
        furthest_m = max(config.min_leap_m, config.max_speed_m_s * seconds)
        furthest_rad = max(config.min_leap_rad, config.max_turn_rad_s * seconds)
        if _is_origin(T_odom_base):
            furthest_m, furthest_rad = ORIGIN_M, ORIGIN_RAD
        return not (math.hypot(step.x, step.y) <= furthest_m and abs(step.theta) <= furthest_rad)

    def _has_restarted(self, T_odom_base: Pose2) -> bool:
        """Whether a pose is near the origin of the odometry, or at it, and the last one was not."""
        if self._raw is None:
            return False
        if _is_origin(T_odom_base):
            return not _is_origin(self._raw)
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
        open_m2 = before.open_m2 + fraction * (after.open_m2 - before.open_m2)
        led_s = before.led_s + fraction * (after.led_s - before.led_s)
        return PathPoint(stamp_ns, pose, path_m, before.discontinuities, open_m2, led_s, before.blind_s)


def _is_origin(T_odom_base: Pose2) -> bool:
    """Whether a pose is the odometry's origin, but for rounding."""
    return max(abs(T_odom_base.x), abs(T_odom_base.y), abs(T_odom_base.theta)) < ROUNDING
