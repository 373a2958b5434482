"""Odometry whose pose never changes: its twist is integrated instead."""

import math

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import NANOSECOND_S, Odometry

MOVES_M_S, MOVES_RAD_S = 0.05, 0.1  # of a twist: less may be the noise of a gyroscope
MOVED_S = 0.5  # of such a twist, while the pose stands: longer than wheels need to follow a command
LONGEST_S = 1.0  # between two messages: for so long a twist is assumed to last
LEADS = "the pose never changes while the twist moves: the twist is integrated instead"
ENDS = "the pose changes now: it is used from here on, not the twist"


class TwistOdometry:
    """Gives the pose of each message, or what its twist adds up to once it is clear that the pose is never filled."""

    def __init__(self) -> None:
        self._first: Odometry | None = None
        self._last: Odometry | None = None
        self._integrated = Pose2()
        self._moved_s = 0.0
        self._is_filled = False
        self.leads = False

    def follow(self, m: Odometry) -> tuple[Pose2, str]:
        """The next message's pose, and what is to be told."""
        if self._is_filled:
            return m.pose, ""
        if self._first is None or self._last is None:
            self._first = self._last = m
            self._integrated = m.pose if m.pose.is_finite() else Pose2()
            return m.pose, ""
        if not _is_same(m.pose, self._first.pose):
            ended, self.leads, self._is_filled = self.leads, False, True
            return m.pose, ENDS if ended else ""
        self._integrate(self._last, m)
        self._last = m
        begins = not self.leads and self._moved_s >= MOVED_S
        self.leads |= begins
        return (self._integrated if self.leads else m.pose), (LEADS if begins else "")

    def _integrate(self, before: Odometry, after: Odometry) -> None:
        """Go on by the mean of two twists, along an arc."""
        seconds = min(max((after.stamp_ns - before.stamp_ns) * NANOSECOND_S, 0.0), LONGEST_S)
        vx, vy, omega = (0.5 * (a + b) for a, b in zip(before.twist, after.twist, strict=True))
        if not all(map(math.isfinite, (vx, vy, omega))):
            return
        turn = omega * seconds
        half = Pose2(0.0, 0.0, 0.5 * turn)
        chord = math.sin(0.5 * turn) / (0.5 * turn) if abs(turn) > 1e-9 else 1.0
        step = half @ Pose2(chord * vx * seconds, chord * vy * seconds, 0.0) @ half
        self._integrated = self._integrated @ step
        if math.hypot(vx, vy) > MOVES_M_S or abs(omega) > MOVES_RAD_S:
            self._moved_s += seconds


def _is_same(a: Pose2, b: Pose2) -> bool:
    """Whether two poses are equal; a heading that is no number, from a quaternion of zeros, equals itself."""
    headless = math.isnan(a.theta) and math.isnan(b.theta)
    return a.x == b.x and a.y == b.y and (a.theta == b.theta or headless)
