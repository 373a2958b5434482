"""How long a sweep takes: a time_increment that makes it longer than the time between two scans is not one of beams."""

import math
from collections import deque
from dataclasses import replace

from wayfi.frontends.lasers.bearings import DRIVER, TURN_RAD
from wayfi.frontends.measurements import NANOSECOND_S, SECOND_NS, LaserScan

LONGER = 1.3  # than the time between scans: that of a motor varies, and some sweeps overlap a little
STEPS, ENOUGH_STEPS = 9, 3  # between scans, whose median is the time between them
LONGEST_STEP_NS = 2 * SECOND_NS  # a longer one is a pause
UNITS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
NEAR = 0.6  # of the time that a turn should take, or more: the increment has this unit


class SweepTime:
    """Checks the time increments of one laser's scans by the stamps between them."""

    def __init__(self) -> None:
        self._last_ns: int | None = None
        self._steps_ns: deque[int] = deque(maxlen=STEPS)

    def check(self, scan: LaserScan) -> tuple[LaserScan, str]:
        """The scan with a time increment that can be, and what was wrong with it, empty where nothing was."""
        if self._last_ns is not None and 0 < scan.stamp_ns - self._last_ns < LONGEST_STEP_NS:
            self._steps_ns.append(scan.stamp_ns - self._last_ns)
        self._last_ns = scan.stamp_ns
        if not math.isfinite(scan.time_increment_s):
            return replace(scan, time_increment_s=0.0), ""
        between_s = self._between_s(scan)
        sweep_s = scan.time_increment_s * len(scan.ranges)
        if between_s is None or sweep_s <= LONGER * between_s:
            return scan, ""
        expected_s = between_s * min(abs(scan.angle_increment) * len(scan.ranges) / TURN_RAD, 1.0)
        used_s, why = _believed(scan, expected_s, LONGER * between_s)
        stated = f"a time_increment of {scan.time_increment_s:g} s makes a sweep of {sweep_s:.2g} s"
        text = f"{stated}, with {between_s:.2g} s between scans: {why}a sweep of {used_s:.2g} s is used; {DRIVER}"
        return replace(scan, time_increment_s=used_s / len(scan.ranges)), text

    def _between_s(self, scan: LaserScan) -> float | None:
        """The time between scans by their stamps, at first what the driver says of it; None while nothing tells."""
        if len(self._steps_ns) >= ENOUGH_STEPS:
            steps_ns, last = sorted(self._steps_ns), len(self._steps_ns) - 1
            return 0.5 * (steps_ns[last // 2] + steps_ns[(last + 1) // 2]) * NANOSECOND_S
        stated_s = scan.scan_time_s
        return stated_s if stated_s is not None and 0.0 < stated_s < math.inf else None


def _believed(scan: LaserScan, expected_s: float, most_s: float) -> tuple[float, str]:
    """How long the sweep took, about `expected_s` and not over `most_s`, and what the time increment seems to be."""
    beams, stated = len(scan.ranges), scan.time_increment_s
    if NEAR * expected_s <= stated <= most_s:
        return stated, "it is the whole sweep's, and "
    for unit, seconds in UNITS.items():
        if NEAR * expected_s <= stated * beams * seconds <= most_s:
            return stated * beams * seconds, f"it is in {unit}, and "
    return expected_s, ""
