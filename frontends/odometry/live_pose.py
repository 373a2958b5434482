"""The pose at the rate of the odometry: from the newest estimate that is known, without waiting for the next."""

from collections import deque
from dataclasses import dataclass
from typing import Self

import numpy as np

from wayfi.backend.graph.health import State
from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.pose2 import Floats, Pose2, adjoint
from wayfi.frontends.events import PosePublished
from wayfi.frontends.measurements import Odometry, Sensor
from wayfi.frontends.odometry.driven_path import (
    DrivenPath,
    OdometryConfig,
    PathPoint,
    calibration_prior,
    fault_of,
    wheel_covariance,
)
from wayfi.frontends.odometry.timebase import TimeBase

ORIGIN_COVARIANCE = np.diag([1e-8, 1e-8, 1e-8])


@dataclass(frozen=True, slots=True, eq=False)
class Anchor:
    """What poses between two keyframes hang on: the newest keyframe, and what is believed of the wheels from there.

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
        dx, dy = T.x - self.T_map_base.x, T.y - self.T_map_base.y
        lever = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
        turn = adjoint(Pose2(0.0, 0.0, self.T_map_base.theta))
        wheels = wheel_covariance(motion, config, self.covariance_scale)
        covariance = lever @ self.covariance @ lever.T + turn @ wheels @ turn.T
        unsure = motion.discontinuities and self.state is State.TRACKING
        state = State.UNCERTAIN if unsure else self.state
        return PosePublished(point.stamp_ns, T, T @ T_odom_base.inverse(), T_odom_base, covariance, state)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """What was known after `odometry` messages of odometry: the time base, the path's end, and the anchor.

    No anchor: the laser leads, and the pose is not the odometry's to tell. `serial` counts a drive's estimates from 1.
    """

    serial: int
    odometry: int
    time: TimeBase
    wheels: DrivenPath
    anchor: Anchor | None


class LivePose:
    """Feed it odometry as it comes, and estimates as they become known: they may be of any number of messages ago.

    The same calls in the same order give the same poses.
    """

    def __init__(self, config: OdometryConfig, calibration: WheelCalibration | None = None) -> None:
        self._config = config
        self._calibration = (calibration or calibration_prior(config)).values
        self._begun = False
        self._since: deque[Odometry] = deque()
        self._estimate = Estimate(0, 0, TimeBase(), DrivenPath(config), None)

    @classmethod
    def resumed(cls, config: OdometryConfig, calibration: WheelCalibration | None, estimate: Estimate) -> Self:
        """One that goes on where all odometry so far is in `estimate`."""
        live = cls(config, calibration)
        live.adopt(estimate)
        return live

    @property
    def serial(self) -> int:
        """The estimate in use; 0 before the first."""
        return self._estimate.serial

    def take(self, m: Odometry) -> PosePublished | None:
        """The pose for the next message; None where it is not used, or the laser leads."""
        self._since.append(m)
        return self._pose_for(m)

    def adopt(self, estimate: Estimate) -> list[PosePublished]:
        """Go on from `estimate`, which belongs to this object from now on.

        Returns the poses of messages since then that had none, because the laser led until now.
        """
        laser_led = self._estimate.anchor is None
        for _ in range(min(estimate.odometry - self._estimate.odometry, len(self._since))):
            self._since.popleft()
        self._estimate = estimate
        self._begun = True
        reached = [(m, self._advance(m)) for m in self._since]
        if not laser_led or estimate.anchor is None:
            return []
        return [estimate.anchor.pose_at(point, m.pose, self._config) for m, point in reached if point is not None]

    def _pose_for(self, m: Odometry) -> PosePublished | None:
        point = self._advance(m)
        if point is None:
            return None
        if not self._begun:
            self._begin(point)
        anchor = self._estimate.anchor
        return anchor.pose_at(point, m.pose, self._config) if anchor else None

    def _advance(self, m: Odometry) -> PathPoint | None:
        """The path's end with this message; None where it is not used."""
        estimate, wheels = self._estimate, self._estimate.wheels
        if fault_of(m.pose):
            return None
        stamped = estimate.time.accept(Sensor.ODOM, m.stamp_ns)
        if stamped.dropped or (wheels.latest and stamped.stamp_ns <= wheels.latest.stamp_ns):
            return None
        wheels.advance(stamped.stamp_ns, m.pose)
        return wheels.latest

    def _begin(self, point: PathPoint) -> None:
        """The first pose is the origin of `map`."""
        self._begun = True
        anchor = Anchor(point, Pose2(), ORIGIN_COVARIANCE, self._calibration, 1.0, State.TRACKING)
        at_start = self._estimate
        self._estimate = Estimate(at_start.serial, at_start.odometry, at_start.time, at_start.wheels, anchor)
