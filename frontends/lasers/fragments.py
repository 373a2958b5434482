"""Joins the fragments of a turn into one scan: some drivers send each packet of a turning laser as a scan of its own.

They are recognised by their first bearing, which walks on from message to message by just the angle that the message
before covered. That of a laser with a small field of view stays where it is.
"""

import math
from dataclasses import replace

import numpy as np

from wayfi.backend.pose2 import wrap
from wayfi.frontends.lasers.bearings import TURN_RAD
from wayfi.frontends.measurements import NANOSECOND_S, SECOND_NS, LaserScan

MOST_SHARE = 0.9  # of a turn: a larger scan is none of its fragments
MOST_BEAMS = 50_000  # of a turn, to bound memory
OFF_BEAMS = 1.5  # that a fragment may begin beside the end of the one before
WALKED, MOST_WALKED = 2, 4  # of a count of scans that walk on, less those that do not: from 2 on they are fragments
LONGEST_TURN_NS = SECOND_NS  # from the first to the last fragment; what comes later begins another turn


class Fragments:
    """One laser's scans: fragments are held until their turn is complete, whole scans pass through."""

    def __init__(self) -> None:
        self._walked = 0
        self._before: LaserScan | None = None
        self._begin: LaserScan | None = None  # where the walk began
        self._turn: list[tuple[int, LaserScan]] = []  # each with the number of its first beam in the turn

    @property
    def joins(self) -> bool:
        """Whether the laser's scans are fragments."""
        return self._walked >= WALKED

    def add(self, scan: LaserScan) -> list[LaserScan]:
        """Add the next scan; returns those that are complete by it."""
        walks_on = self._walks_on(scan)
        returns = not walks_on and self._returns(scan)
        self._walked = max(0, min(MOST_WALKED, self._walked + (1 if walks_on or returns else -1)))
        if not walks_on:
            self._begin = scan
        self._before = scan
        if not (self.joins and _is_part(scan)):
            return [*self.finish(), scan]
        out = self.finish() if returns or not self._continues(scan) else []
        self._turn.append((self._first_beam(scan), scan))
        return out + (self.finish() if self._is_complete() else [])

    def finish(self) -> list[LaserScan]:
        """The scan of the fragments that wait, if any do."""
        turn, self._turn = self._turn, []
        return [_joined(turn)] if turn else []

    def _walks_on(self, scan: LaserScan) -> bool:
        before = self._before
        if before is None or not (_is_part(before) and _is_part(scan)):
            return False
        return _is_near(scan.angle_min, before.angle_min + len(before.ranges) * before.angle_increment, before)

    def _returns(self, scan: LaserScan) -> bool:
        """Whether a scan begins where the walk began, after it went on from there."""
        before, begin = self._before, self._begin
        if before is None or begin is None or before is begin or not _is_part(scan):
            return False
        return _is_near(scan.angle_min, begin.angle_min, begin)

    def _first_beam(self, scan: LaserScan) -> int:
        """The number of a scan's first beam in the turn that waits; 0 where none does."""
        if not self._turn:
            return 0
        first = self._turn[0][1]
        turned = math.copysign(1.0, first.angle_increment) * (scan.angle_min - first.angle_min)
        step = abs(first.angle_increment)
        return round(math.fmod(turned + TURN_RAD + 0.5 * step, TURN_RAD) / step - 0.5) % _beams_of_turn(first)

    def _continues(self, scan: LaserScan) -> bool:
        """Whether a fragment lies behind those of the turn that waits."""
        if not self._turn:
            return True
        (_, first), (begin, last) = self._turn[0], self._turn[-1]
        same = abs(scan.angle_increment - first.angle_increment) < 0.01 * abs(first.angle_increment)
        behind = self._first_beam(scan) >= begin + len(last.ranges) - OFF_BEAMS
        return same and behind and 0 <= scan.stamp_ns - first.stamp_ns < LONGEST_TURN_NS

    def _is_complete(self) -> bool:
        begin, last = self._turn[-1]
        return begin + len(last.ranges) >= _beams_of_turn(self._turn[0][1]) - OFF_BEAMS


def _is_part(scan: LaserScan) -> bool:
    """Whether a scan may be part of a turn, and is not nearly all of it."""
    step = abs(scan.angle_increment)
    return step * MOST_BEAMS >= TURN_RAD and 0 < step * len(scan.ranges) < MOST_SHARE * TURN_RAD


def _is_near(a: float, b: float, scan: LaserScan) -> bool:
    """Whether two bearings are the same, give or take a beam of a scan and whole turns."""
    return abs(wrap(a - b)) <= OFF_BEAMS * abs(scan.angle_increment)


def _beams_of_turn(scan: LaserScan) -> int:
    return max(1, round(TURN_RAD / abs(scan.angle_increment)))


def _joined(turn: list[tuple[int, LaserScan]]) -> LaserScan:
    """One scan of a turn's fragments, its beams as far after each other as their stamps say."""
    first, (begin, last) = turn[0][1], turn[-1]
    ranges = np.full(begin + len(last.ranges), np.nan, np.float32)
    for number, fragment in turn:
        ranges[number : number + len(fragment.ranges)] = fragment.ranges
    seconds = (last.stamp_ns - first.stamp_ns) * NANOSECOND_S
    each_s = seconds / begin if begin and seconds > 0 else first.time_increment_s
    return replace(first, ranges=ranges, time_increment_s=each_s, angle_max=None, scan_time_s=None)
