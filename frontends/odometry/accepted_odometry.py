"""Decides which odometry messages extend the driven path: by faults, the time base and their order.

The pipeline and the live pose both use it, so that they accept the same messages and get the same path, bit for bit.
"""

from copy import deepcopy
from dataclasses import dataclass
from typing import Self

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import Odometry, Sensor
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.timebase import TimeBase

FURTHEST_M = 1e8  # from the odometry's origin: further than any robot drives, and float64 still resolves 0.02 um


@dataclass(frozen=True, slots=True)
class Accepted:
    """What became of a message: its new `point` of the path, or why it is `dropped`; its stamp is on the time base.

    `shift_ns` is set where the time base was moved, `ends_laser_lead` for the first sound message after the laser led.
    `plausible`: the step was no further than a robot drives; otherwise it counts as no motion.
    """

    stamp_ns: int
    point: PathPoint | None = None
    dropped: DropReason | None = None
    shift_ns: int = 0
    ends_laser_lead: bool = False
    plausible: bool = True


class AcceptedOdometry:
    """The driven `path` and the `time` base of a drive; `received` counts the messages, the dropped ones included."""

    def __init__(self, config: OdometryConfig) -> None:
        self.time = TimeBase(config.clock)
        self.path = DrivenPath(config)
        self.received = 0
        self._laser_leads = False

    def accept(self, m: Odometry) -> Accepted:
        """Add the next message of the wheels to the path, unless it has to be dropped."""
        self.received += 1
        if fault := fault_of(m.pose):
            return Accepted(m.stamp_ns, dropped=fault)
        stamped = self.time.accept(Sensor.ODOM, m.stamp_ns)
        if stamped.dropped:
            return Accepted(stamped.stamp_ns, None, stamped.dropped, stamped.shift_ns)
        ends_lead = self._end_laser_lead()
        latest = self.path.latest
        if latest is not None and stamped.stamp_ns <= latest.stamp_ns:
            return Accepted(stamped.stamp_ns, None, DropReason.TOO_LATE, stamped.shift_ns, ends_lead)
        plausible = self.path.advance(stamped.stamp_ns, m.pose)
        return Accepted(stamped.stamp_ns, self.path.latest, None, stamped.shift_ns, ends_lead, plausible)

    def begin_laser_lead(self) -> None:
        """Let the laser lead until the next sound message of the wheels."""
        self._laser_leads = True
        self.path.restart()

    def follow_laser(self, stamp_ns: int, T_odom_base: Pose2) -> Accepted:
        """Add a pose by the laser, which leads, to the path; its stamp is later than the path's end."""
        plausible = self.path.advance(stamp_ns, T_odom_base)
        return Accepted(stamp_ns, self.path.latest, plausible=plausible)

    def tip(self) -> Self:
        """A copy whose path holds its newest point alone."""
        return deepcopy(self, {id(self.path): self.path.tip()})

    def _end_laser_lead(self) -> bool:
        """Let the wheels lead; returns whether the laser did."""
        ended, self._laser_leads = self._laser_leads, False
        if ended:
            self.path.restart()
        return ended


def fault_of(T_odom_base: Pose2) -> DropReason | None:
    """Why a pose is dropped; None if it can be odometry."""
    if not T_odom_base.is_finite():
        return DropReason.NON_FINITE
    absurd = max(abs(T_odom_base.x), abs(T_odom_base.y)) > FURTHEST_M
    return DropReason.IMPLAUSIBLE_MOTION if absurd else None
