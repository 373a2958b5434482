"""Odometry whose pose, position or heading never changes: its twist is integrated instead."""

import math
from dataclasses import dataclass

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import NANOSECOND_S, Odometry

MOVES_M_S, MOVES_RAD_S = 0.05, 0.1  # of a twist: less may be the noise of a gyroscope
MOVED_S = 0.5  # of such a twist, while the pose stands: longer than wheels need to follow a command
MOVED_MESSAGES = 3  # with such a twist: where they are rare, a heading that is rounded may be the same in two
LONGEST_S = 1.0  # between two messages: for so long a twist is assumed to last
LEADS = "the pose never changes while the twist moves: the twist is integrated instead"
ENDS = "the pose changes now: it is used from here on, not the twist"


@dataclass(slots=True)
class _Part:
    """The position or the heading: whether it has ever changed, and how long and how often the twist moved it."""

    changed: bool = False
    moved_s: float = 0.0
    moves: int = 0

    @property
    def integrated(self) -> bool:
        """Whether it is clear that it is never filled."""
        return not self.changed and self.moved_s >= MOVED_S and self.moves >= MOVED_MESSAGES

    def move(self, seconds: float) -> None:
        """Note that the twist moved it for so long until the next message."""
        self.moved_s, self.moves = self.moved_s + seconds, self.moves + 1


class TwistOdometry:
    """Gives the pose of each message, or what its twist adds up to where it is clear that the pose is never filled."""

    def __init__(self) -> None:
        self._first: Pose2 | None = None
        self._last: Odometry | None = None
        self._T = Pose2()
        self._position, self._heading = _Part(), _Part()

    def follow(self, m: Odometry) -> tuple[Pose2, str]:
        """The next message's pose, and what is to be told."""
        if self._first is None or self._last is None:
            self._first, self._last = m.pose, m
            self._T = m.pose if m.pose.is_finite() else Pose2()
        if self._position.changed and self._heading.changed:
            return m.pose, ""
        integrated = self._integrates
        self._compare(self._first, m.pose)
        self._integrate(self._last, m)
        self._last = m
        if not self._integrates:
            return m.pose, ENDS if integrated else ""
        position = self._T if self._position.integrated else m.pose
        heading = m.pose.theta if self._heading.changed else self._T.theta
        return Pose2(position.x, position.y, heading), "" if integrated else LEADS

    @property
    def _integrates(self) -> bool:
        return self._position.integrated or self._heading.integrated

    def _compare(self, first: Pose2, pose: Pose2) -> None:
        """Note what has changed since the first pose; a heading of NaN, from a quaternion of zeros, is none."""
        self._position.changed |= (pose.x, pose.y) != (first.x, first.y)
        self._heading.changed |= math.isfinite(pose.theta) and pose.theta != first.theta

    def _integrate(self, before: Odometry, after: Odometry) -> None:
        """Go on by the mean of two twists, along an arc; by the change of the heading where that is filled."""
        seconds = min(max((after.stamp_ns - before.stamp_ns) * NANOSECOND_S, 0.0), LONGEST_S)
        vx, vy, omega = (0.5 * (a + b) for a, b in zip(before.twist, after.twist, strict=True))
        if not math.isfinite(vx + vy + omega):
            return
        turn = after.pose.theta - self._T.theta if self._heading.changed else omega * seconds
        if math.isfinite(turn):
            half = Pose2(0.0, 0.0, 0.5 * turn)
            self._T = self._T @ half @ Pose2(vx * seconds, vy * seconds, 0.0) @ half
        drives = math.hypot(vx, vy) > MOVES_M_S
        turns = abs(omega) > MOVES_RAD_S or (drives and omega != 0.0)  # wheels that roll keep no heading to the bit
        if drives:
            self._position.move(seconds)
        if turns:
            self._heading.move(seconds)
