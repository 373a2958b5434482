"""Gives the pose at the rate of the odometry, extrapolated from the newest estimate."""

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.graph.health import State
from wayfi.backend.graph.wheel_calibration import WheelCalibration, WheelMotion
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import PosePublished
from wayfi.frontends.measurements import Odometry
from wayfi.frontends.odometry.accepted_odometry import AcceptedOdometry
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior
from wayfi.frontends.odometry.wheel_noise import wheel_covariance

ESTIMATE_EVERY = 50  # messages of odometry without a keyframe: bounds what a live pose accepts again to 0.5 to 5 s
ORIGIN_COVARIANCE = np.diag([1e-8, 1e-8, 1e-8])  # m^2, rad^2: 0 by definition, kept positive definite


@dataclass(frozen=True, slots=True, eq=False)
class Anchor:
    """The newest keyframe and the wheels' calibration there: poses since then are extrapolated from both.

    `covariance` (3, 3) is the keyframe's in (x, y, theta) of `map`; `calibration` (4,) is the wheels', and so is
    `covariance_scale`, a factor on the covariance of their noise.
    """

    point: PathPoint
    T_map_base: Pose2
    covariance: Floats
    calibration: Floats
    covariance_scale: float
    state: State

    def pose_at(self, point: PathPoint, T_odom_base: Pose2, config: OdometryConfig) -> PosePublished:
        """The pose in `map` at a point of the path, by the wheels from the keyframe."""
        motion = self.point.motion_to(point)
        T = self.T_map_base @ motion.corrected(self.calibration)
        wheels = wheel_covariance(_in_axes_of_map(motion, self.T_map_base.theta), config, self.covariance_scale)
        covariance = _moved(self.covariance, T.x - self.T_map_base.x, T.y - self.T_map_base.y) + wheels
        unsure = motion.discontinuities and self.state is State.TRACKING
        state = State.UNCERTAIN if unsure else self.state
        return PosePublished(point.stamp_ns, T, T @ T_odom_base.inverse(), T_odom_base, covariance, state)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """The state of the estimation after a message: the `odometry` accepted so far, and the `anchor`.

    A live pose extrapolates from it. `anchor` is None while no pose is claimed, and while the laser leads, since no
    odometry extrapolates then.
    `serial` counts a drive's estimates from 1.
    """

    serial: int
    odometry: AcceptedOdometry
    anchor: Anchor | None


@dataclass(slots=True)
class EstimateSchedule:
    """When the next estimate is due: at the last, so many `keyframes` and messages of `odometry` had come."""

    keyframes: int = 0
    odometry: int = 0
    claimed: bool = False

    def is_due(self, keyframes: int, odometry: int, claimed: bool) -> bool:
        """Whether one is due by these counts, which are noted then, or by a pose that is claimed or given up."""
        unchanged = (keyframes, claimed) == (self.keyframes, self.claimed)
        if unchanged and odometry < self.odometry + ESTIMATE_EVERY:
            return False
        self.keyframes, self.odometry, self.claimed = keyframes, odometry, claimed
        return True


class LivePose:
    """Gives a pose for each odometry message at once, by the newest estimate, which may be some messages old.

    It reads no clock: the same calls in the same order give the same poses. Only a drive that `begins_map` has a pose
    before the first estimate: the origin.
    """

    def __init__(
        self, config: OdometryConfig, calibration: WheelCalibration | None = None, begins_map: bool = True
    ) -> None:
        self._config = config
        self._calibration = (calibration or calibration_prior(config)).values
        self._begins_map = begins_map
        self._since: deque[Odometry] = deque()
        self._estimate = Estimate(0, AcceptedOdometry(config), None)

    def add(self, m: Odometry) -> PosePublished | None:
        """The pose for the next message; None where it is dropped, no pose is claimed, or the laser leads."""
        self._since.append(m)
        accepted = self._estimate.odometry.accept(m)
        point = accepted.point
        if point is None:
            return None
        if self._begins_map and self._estimate.serial == 0 and self._estimate.anchor is None:
            self._begin(point)
        anchor = self._estimate.anchor
        return anchor.pose_at(point, accepted.T_odom_base, self._config) if anchor else None

    def adopt(self, estimate: Estimate) -> list[PosePublished]:
        """Go on from `estimate`, of which this object becomes the owner, and accept again what came after it.

        Returns poses for the messages after it where there were none before.
        """
        stood_in = self._estimate.anchor is None
        newer = max(0, self._estimate.odometry.received - estimate.odometry.received)
        while len(self._since) > newer:
            self._since.popleft()
        self._estimate = estimate
        reached = [estimate.odometry.accept(m) for m in self._since]
        anchor = estimate.anchor
        if not stood_in or anchor is None:
            return []
        return [anchor.pose_at(a.point, a.T_odom_base, self._config) for a in reached if a.point is not None]

    def _begin(self, point: PathPoint) -> None:
        """The first pose is the origin of `map`."""
        anchor = Anchor(point, Pose2(), ORIGIN_COVARIANCE, self._calibration, 1.0, State.TRACKING)
        self._estimate = replace(self._estimate, anchor=anchor)


def _in_axes_of_map(motion: WheelMotion, theta: float) -> WheelMotion:
    """A motion from a keyframe that heads `theta` (rad) in `map`, its x and y along the axes of that."""
    c, s = math.cos(theta), math.sin(theta)
    x, y = motion.pose.x, motion.pose.y
    return motion._replace(pose=Pose2(c * x - s * y, s * x + c * y, motion.pose.theta))


def _moved(covariance: Floats, dx: float, dy: float) -> Floats:
    """The (3, 3) covariance of a pose in `map` as that of one (dx, dy) m further, which its heading moves sideways."""
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = covariance.tolist()
    moved_xt, moved_yt = xt - dy * tt, yt + dx * tt
    moved_xx, moved_yy = xx - dy * (xt + moved_xt), yy + dx * (yt + moved_yt)
    moved_xy = xy + dx * xt - dy * moved_yt
    return np.array([[moved_xx, moved_xy, moved_xt], [moved_xy, moved_yy, moved_yt], [moved_xt, moved_yt, tt]])
