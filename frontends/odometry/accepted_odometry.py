"""Decides which odometry messages extend the driven path: by faults, the time base and their order.

The pipeline and the live pose both use it, so that they accept the same messages and get the same path, bit for bit.
"""

from copy import deepcopy
from typing import Self

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import Odometry, Sensor
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.timebase import Stamped, TimeBase

FURTHEST_M = 1e8  # from the odometry's origin: further than any robot drives, and float64 still resolves 0.02 um


class AcceptedOdometry:
    """The driven `path` and the `time` base of a drive; `received` counts the messages, the dropped ones included."""

    def __init__(self, config: OdometryConfig) -> None:
        self.time = TimeBase(config.clock)
        self.path = DrivenPath(config)
        self.received = 0

    def accept(self, m: Odometry) -> PathPoint | None:
        """Add the next message to the path; returns its point, None where the message is dropped."""
        stamped = self.stamp(m)
        if stamped.dropped or self.is_late(stamped.stamp_ns):
            return None
        self.path.advance(stamped.stamp_ns, m.pose)
        return self.path.latest

    def stamp(self, m: Odometry) -> Stamped:
        """Count the next message; returns its stamp on the time base, or why it is dropped."""
        self.received += 1
        if fault := fault_of(m.pose):
            return Stamped(m.stamp_ns, fault)
        return self.time.accept(Sensor.ODOM, m.stamp_ns)

    def is_late(self, stamp_ns: int) -> bool:
        """Whether a stamp on the time base is no later than the path's end."""
        return self.path.latest is not None and stamp_ns <= self.path.latest.stamp_ns

    def tip(self) -> Self:
        """A copy whose path holds its newest point alone."""
        return deepcopy(self, {id(self.path): self.path.tip()})


def fault_of(T_odom_base: Pose2) -> DropReason | None:
    """Why a pose is dropped; None if it can be odometry."""
    if not T_odom_base.is_finite():
        return DropReason.NON_FINITE
    absurd = max(abs(T_odom_base.x), abs(T_odom_base.y)) > FURTHEST_M
    return DropReason.IMPLAUSIBLE_MOTION if absurd else None
