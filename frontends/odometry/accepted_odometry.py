"""Decides which odometry messages extend the driven path: by faults, the time base and their order.

The pipeline and the live pose both use it, so that they accept the same messages and get the same path, bit for bit.
"""

import math
from copy import deepcopy
from dataclasses import replace
from typing import NamedTuple, Self

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import Odometry, Sensor
from wayfi.frontends.odometry.driven_path import DrivenPath, LedStep, PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.odometry_source import OdometrySource
from wayfi.frontends.odometry.timebase import TimeBase
from wayfi.frontends.odometry.twist_odometry import ENDS, TwistOdometry
from wayfi.frontends.odometry.unit_watch import UnitWatch

FURTHEST_M = 1e8  # from the odometry's origin: further than any robot drives, and float64 still resolves 0.02 um
SEEN = LedStep()
HEADLESS_MESSAGES = 5  # in a row: a robot that drives, not a message that is broken
HEADLESS = "the odometry's orientation is a quaternion of zeros: such messages are not used"


class Accepted(NamedTuple):
    """What became of a message: its new `point` of the path, or why it is `dropped`; its stamp is on the time base.

    `T_odom_base` is the pose that is used of it. `shift_ns` is set where the time base was moved, `ends_stand_in` for
    the first sound message after the laser or /tf led. `plausible`: the step was one that a robot drives; otherwise it
    counts as no motion. `told` is what is to be told.
    """

    stamp_ns: int
    point: PathPoint | None = None
    dropped: DropReason | None = None
    shift_ns: int = 0
    ends_stand_in: bool = False
    plausible: bool = True
    T_odom_base: Pose2 = Pose2()
    told: str = ""


class AcceptedOdometry:
    """The driven `path` and the `time` base of a drive; `received` counts the messages, the dropped ones included."""

    def __init__(self, config: OdometryConfig) -> None:
        self.time = TimeBase(config.clock)
        self.path = DrivenPath(config)
        self.received = 0
        self._source = OdometrySource(config.laser_lead_s)
        self._twist = TwistOdometry()
        self._units = UnitWatch(config.unit_m)
        self._headless = 0
        self._stand_in_leads = False

    def accept(self, m: Odometry) -> Accepted:
        """Add the next message of the wheels to the path, unless it has to be dropped."""
        self.received += 1
        follows, switched = self._source.follows(m)
        if not follows:
            return Accepted(m.stamp_ns, dropped=DropReason.OTHER_SOURCE, told=switched)
        pose, integrated = self._twist.follow(m)
        pose, converted = self._units.convert(m.stamp_ns, pose)
        if switched or converted or integrated == ENDS:
            self.path.restart()
            self.path.forget_aside()
        told = switched or integrated or converted or self._tell_if_headless(pose)
        accepted = self._add(m if pose is m.pose else replace(m, pose=pose), Sensor.ODOM)
        return accepted._replace(told=told) if told else accepted

    def follow_transform(self, m: Odometry) -> Accepted:
        """Add a pose by /tf, which leads, to the path, unless it has to be dropped."""
        return self._add(m, Sensor.TF)

    def _add(self, m: Odometry, sensor: Sensor) -> Accepted:
        if fault := fault_of(m.pose):
            return Accepted(m.stamp_ns, dropped=fault)
        stamped = self.time.accept(m.stamp_ns, sensor)
        if stamped.dropped:
            return Accepted(stamped.stamp_ns, None, stamped.dropped, stamped.shift_ns)
        ended = sensor is Sensor.ODOM and self._end_stand_in()
        latest = self.path.latest
        if latest is not None and stamped.stamp_ns <= latest.stamp_ns:
            self.path.rejoin(m.pose)
            return Accepted(stamped.stamp_ns, None, DropReason.TOO_LATE, stamped.shift_ns, ended)
        plausible = self.path.advance(stamped.stamp_ns, m.pose)
        return Accepted(stamped.stamp_ns, self.path.latest, None, stamped.shift_ns, ended, plausible, m.pose)

    def begin_stand_in(self) -> None:
        """Let the laser or /tf lead until the next sound message of the wheels."""
        if self._stand_in_leads:
            self.path.restart()
        else:
            self.path.set_aside()
        self._stand_in_leads = True

    def follow_laser(self, stamp_ns: int, T_odom_base: Pose2, led: LedStep = SEEN) -> Accepted:
        """Add a pose by the laser, which leads, to the path; its stamp is later than the path's end."""
        plausible = self.path.advance(stamp_ns, T_odom_base, led)
        return Accepted(stamp_ns, self.path.latest, plausible=plausible, T_odom_base=T_odom_base)

    def tip(self) -> Self:
        """A copy whose path holds its newest point alone."""
        return deepcopy(self, {id(self.path): self.path.tip()})

    def _tell_if_headless(self, pose: Pose2) -> str:
        """What is said of orientations that are quaternions of zeros, once there are some in a row."""
        headless = math.isnan(pose.theta) and math.isfinite(pose.x + pose.y)
        self._headless = self._headless + 1 if headless else 0
        return HEADLESS if self._headless == HEADLESS_MESSAGES else ""

    def _end_stand_in(self) -> bool:
        """Let the wheels lead; returns whether the laser or /tf did."""
        ended, self._stand_in_leads = self._stand_in_leads, False
        if ended:
            self.path.take_up()
        return ended


def fault_of(T_odom_base: Pose2) -> DropReason | None:
    """Why a pose is dropped; None if it can be odometry."""
    if not T_odom_base.is_finite():
        return DropReason.NON_FINITE
    absurd = max(abs(T_odom_base.x), abs(T_odom_base.y)) > FURTHEST_M
    return DropReason.IMPLAUSIBLE_MOTION if absurd else None
