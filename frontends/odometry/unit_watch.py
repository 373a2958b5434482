"""Odometry in millimetres: told by speeds that no robot has, and converted."""

import math
from collections import deque
from itertools import pairwise

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import NANOSECOND_S

MILLIMETRE_M = 1e-3
STEPS = 10  # in a row, of poses that differ: an odometry that begins anew leaps once
LEAST_M_S, MOST_M_S = 20.0, 5000.0  # of each step; in millimetres a robot from 0.02 to 5 m/s has it
LEAST_AHEAD = 0.5  # of the steps' length, from the first pose to the last: two sources in turn make steps to and fro
TOLD = "odometry looks as if it were in millimetres ({:.0f} m/s): taken as such (--set odometry.unit_m=0.001)"


class UnitWatch:
    """Converts positions to m from units of `unit_m`; where that is 1, from millimetres once steps show that."""

    def __init__(self, unit_m: float) -> None:
        self._unit_m = unit_m
        self._may_change = unit_m == 1.0
        self._recent: deque[tuple[int, Pose2]] = deque(maxlen=STEPS + 1)

    def convert(self, stamp_ns: int, pose: Pose2) -> tuple[Pose2, str]:
        """The pose in m, and what is to be told: with the first pose of which it is clear that it is in mm."""
        told = ""
        if self._may_change and pose.is_finite():
            speed_m_s = self._speed_of_all_m_s(stamp_ns, pose)
            if speed_m_s:
                self._unit_m, self._may_change = MILLIMETRE_M, False
                self._recent.clear()
                told = TOLD.format(speed_m_s)
        return (pose if self._unit_m == 1.0 else Pose2(self._unit_m * pose.x, self._unit_m * pose.y, pose.theta)), told

    def _speed_of_all_m_s(self, stamp_ns: int, pose: Pose2) -> float:
        """The mean speed of the last steps if no robot has it in m/s, and any in mm/s; else 0."""
        recent = self._recent
        if recent and stamp_ns < recent[-1][0]:
            recent.clear()  # the clock was set, or the stamp before was wrong
        if recent and (pose.distance(recent[-1][1]) == 0.0 or stamp_ns == recent[-1][0]):
            return 0.0
        recent.append((stamp_ns, pose))
        steps = [((b[0] - a[0]) * NANOSECOND_S, a[1].distance(b[1])) for a, b in pairwise(recent)]
        if len(steps) < STEPS or not all(LEAST_M_S < metres / s < MOST_M_S for s, metres in steps):
            return 0.0
        length = math.fsum(metres for _, metres in steps)
        leads_on = recent[0][1].distance(pose) > LEAST_AHEAD * length
        return length / math.fsum(s for s, _ in steps) if leads_on else 0.0
