"""Wheel odometry: increments on a path, the motion between any two moments of it, and when a keyframe is due."""

import math
from bisect import bisect_left, bisect_right
from collections import deque
from dataclasses import dataclass

import numpy as np

from wayfi.backend.graph.wheel_calibration import WheelCalibration, WheelMotion
from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import DropReason

RESTART_M = 0.5  # from its origin, odometry has just begun
DISCONTINUITY_COVARIANCE = np.diag([1.0, 1.0, 0.25])  # m², m², rad²: of a robot that was pushed aside while it was off
FURTHEST_M = 1e8  # from the origin of the odometry: beyond it a number is no place, and millimetres are lost
LONGEST_S = 3600.0  # between two keyframes; a longer gap is a clock's, and would count as years of a gyroscope's bias


@dataclass(frozen=True)
class OdometryConfig:
    """Keyframes, and how wheels err."""

    keyframe_distance_m: float = option(0.5, "m", "a submap keeps its detail, 1 km stays 2,000 keyframes")
    keyframe_turn_rad: float = option(0.5, "rad", "half of what a scan still overlaps when the view is 180 degrees")
    keyframe_seconds: float = option(10.0, "s", "a robot that creeps or waits still gets one, if it moved at all")
    keyframe_still_m: float = option(0.05, "m", "less motion than this is standing still")
    max_speed_m_s: float = option(5.0, "m/s", "indoor robots drive below 3; faster is a reset of the odometry")
    sigma_xy_per_sqrt_m: float = option(0.02, "m per sqrt(m)", "random part of the distance: 2 cm over 1 m")
    sigma_theta_per_sqrt_m: float = option(0.003, "rad per sqrt(m)", "what real logs leave once the bias is known")
    sigma_theta_per_sqrt_rad: float = option(0.02, "rad per sqrt(rad)", "wheels slip when they turn: 1 degree in 1 rad")
    sigma_still_m: float = option(0.003, "m", "what standing still leaves open")
    sigma_still_rad: float = option(0.002, "rad", "as above")
    prior_distance_scale: float = option(0.01, "1", "closures that say '0 m apart' shrink the map where it is loose")
    prior_turn_scale: float = option(0.03, "1", "the wheels' track as it is measured by hand")
    prior_turn_bias_rad_per_m: float = option(0.03, "rad/m", "real robots were seen to turn 0.026 by themselves")
    prior_turn_bias_rad_per_s: float = option(0.0005, "rad/s", "a gyroscope's bias; wheels have none")


def calibration_prior(config: OdometryConfig) -> WheelCalibration:
    """What is believed of the wheels before anything is seen of them."""
    sigmas = np.array(
        [
            config.prior_distance_scale,
            config.prior_turn_scale,
            config.prior_turn_bias_rad_per_m,
            config.prior_turn_bias_rad_per_s,
        ]
    )
    return WheelCalibration(np.zeros(4), sigmas)


def fault_of(T_odom_base: Pose2) -> DropReason | None:
    """Why a pose of the odometry is none, if so."""
    if not T_odom_base.is_finite():
        return DropReason.NON_FINITE
    absurd = max(abs(T_odom_base.x), abs(T_odom_base.y)) > FURTHEST_M
    return DropReason.IMPLAUSIBLE_MOTION if absurd else None


@dataclass(frozen=True, slots=True)
class PathPoint:
    """One odometry pose on the driven path: `T_path_base` joins increments, free of jumps; `path_m` only grows.

    `discontinuities` counts where the odometry was found to have begun anew while nobody looked.
    """

    stamp_ns: int
    T_path_base: Pose2
    path_m: float
    discontinuities: int = 0

    def motion_to(self, later: "PathPoint") -> WheelMotion:
        """What the wheels say of the way from here to `later`."""
        seconds = min((later.stamp_ns - self.stamp_ns) * 1e-9, LONGEST_S)
        pose, path_m = self.T_path_base.between(later.T_path_base), later.path_m - self.path_m
        return WheelMotion(pose, path_m, seconds, later.discontinuities - self.discontinuities)


class DrivenPath:
    """The recent path by odometry. Poses jump when a robot's base restarts; such a step counts as no motion."""

    def __init__(self, config: OdometryConfig, keep_s: float = 30.0) -> None:
        self._config = config
        self._keep_ns = int(keep_s * 1e9)
        self._points: deque[PathPoint] = deque()
        self._raw: Pose2 | None = None
        self._was_away = False

    @property
    def latest(self) -> PathPoint | None:
        """The newest point, None before the first odometry."""
        return self._points[-1] if self._points else None

    def restart(self) -> None:
        """Join the next pose without motion: the source of the odometry has changed."""
        self._raw = None

    def go_on(self) -> None:
        """Some odometry may be missing before the next: it may have begun anew, with the robot moved meanwhile."""
        self._was_away = True

    def tip(self) -> "DrivenPath":
        """A copy that knows the newest point alone."""
        copy = DrivenPath(self._config)
        copy._points.extend(list(self._points)[-1:])
        copy._raw, copy._was_away = self._raw, self._was_away
        return copy

    def advance(self, stamp_ns: int, T_odom_base: Pose2) -> bool:
        """Add a pose; False if the step was not plausible and was taken as no motion."""
        last = self.latest
        plausible, discontinuities = True, last.discontinuities if last else 0
        if last is None:
            point = PathPoint(stamp_ns, T_odom_base, 0.0)
        else:
            step = Pose2() if self._raw is None else self._raw.between(T_odom_base)
            distance = math.hypot(step.x, step.y)
            seconds = (stamp_ns - last.stamp_ns) * 1e-9
            restarted = self._was_away and self._has_restarted(T_odom_base)
            if restarted or not distance <= max(0.5, self._config.max_speed_m_s * seconds):
                plausible, step, distance = False, Pose2(), 0.0
                discontinuities += self._was_away
            point = PathPoint(stamp_ns, last.T_path_base @ step, last.path_m + distance, discontinuities)
        self._raw, self._was_away = T_odom_base, False
        self._points.append(point)
        while self._points[0].stamp_ns < stamp_ns - self._keep_ns and len(self._points) > 2:
            self._points.popleft()
        return plausible

    def _has_restarted(self, T_odom_base: Pose2) -> bool:
        """Whether a pose is about where odometry begins, and the last one was not."""
        if self._raw is None:
            return False
        return math.hypot(T_odom_base.x, T_odom_base.y) < RESTART_M < 0.5 * math.hypot(self._raw.x, self._raw.y)

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

    def since(self, stamp_ns: int) -> list[PathPoint]:
        """The points after a moment, oldest first."""
        i = bisect_right(self._points, stamp_ns, key=lambda p: p.stamp_ns)
        return [self._points[k] for k in range(i, len(self._points))]


def keyframe_due(motion: WheelMotion, config: OdometryConfig, factor: float = 1.0) -> bool:
    """Whether `motion` since the last keyframe asks for a new one; `factor` stretches the distances."""
    if motion.discontinuities:
        return True
    turned = abs(motion.pose.theta)
    if motion.path_m >= factor * config.keyframe_distance_m or turned >= factor * config.keyframe_turn_rad:
        return True
    moved = motion.path_m > config.keyframe_still_m or turned > config.keyframe_still_m
    return moved and motion.seconds >= factor * config.keyframe_seconds


def wheel_covariance(motion: WheelMotion, config: OdometryConfig, covariance_scale: float = 1.0) -> Floats:
    """(3, 3) covariance of the random part of `motion` in (x, y, theta); `covariance_scale` multiplies it.

    A heading error e that builds up along the way leaves e / 2 of the length to the side: hence the y, theta terms.
    """
    length = motion.path_m
    var_xy = config.sigma_xy_per_sqrt_m**2 * length + config.sigma_still_m**2
    var_theta = (
        config.sigma_theta_per_sqrt_m**2 * length
        + config.sigma_theta_per_sqrt_rad**2 * abs(motion.pose.theta)
        + config.sigma_still_rad**2
    )
    x, y = motion.pose.x, motion.pose.y
    lever = np.array([-0.5 * y, 0.5 * x, 1.0])
    covariance: Floats = covariance_scale * (np.diag([var_xy, var_xy, 0.0]) + var_theta * np.outer(lever, lever))
    covariance += np.diag([0.0, 0.0, 1e-8]) + motion.discontinuities * DISCONTINUITY_COVARIANCE
    return covariance
