"""The ranges of a scan and their limits in metres: some drivers send millimetres, and limits that are none."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfi.frontends.lasers.bearings import DRIVER
from wayfi.frontends.lidar.beam_counts import beams_between
from wayfi.frontends.measurements import LaserScan

FAR_M = 100.0  # the median of a scan's returns: indoors it is metres, in other units hundreds
STILL_FAR_M = 20.0  # as above, of a laser that is known to use another unit: at a near wall
MOST_LIMIT_M = 200.0  # no laser measures further: a larger limit is in another unit too
LEAST_MM_LIMIT = 3500.0  # of a range_max in mm; a smaller one is in cm, as 3.5 m is the shortest laser's
LEAST_MM_RETURN = 1500.0  # as above, where no limit tells: 95 of 100 returns are nearer
LEAST_RETURNS = 10  # that tell the unit
SAME_RETURNS = 3  # of one scan, and the largest: what a driver sends where nothing returns
MILLIMETRE_M, CENTIMETRE_M = 1e-3, 1e-2


def with_limits(scan: LaserScan) -> tuple[LaserScan, str]:
    """The scan with limits that can be, and what was wrong with them, empty where nothing was.

    A limit that is not set becomes 0 or infinity.
    """
    low, high = scan.range_min_m, scan.range_max_m
    low = low if 0.0 <= low < math.inf else 0.0
    if not high > 0.0:
        text = f"range_max is {high:g}: no limit is assumed; {DRIVER}"
        return replace(scan, range_min_m=low, range_max_m=math.inf), text
    if low >= high:
        text = f"range_min {low:g} and range_max {high:g} are swapped: used the other way round; {DRIVER}"
        return replace(scan, range_min_m=high, range_max_m=low), text
    return (scan if low == scan.range_min_m else replace(scan, range_min_m=low)), ""


@dataclass(slots=True)
class RangeUnit:
    """The unit of one laser's ranges, `metres` long."""

    metres: float = 1.0

    def check(self, scan: LaserScan) -> tuple[LaserScan, str]:
        """The scan in metres, and what is wrong with its unit, empty where nothing is."""
        if self.metres == 1.0 and not beams_between(scan.ranges, FAR_M, math.inf):
            return scan, ""
        returns = _returns(scan.ranges)
        if len(returns) >= LEAST_RETURNS:
            far = float(np.median(returns)) > (FAR_M if self.metres == 1.0 else STILL_FAR_M)
            if not far:
                self.metres = 1.0
            elif self.metres == 1.0:
                self.metres = _unit_m(scan.range_max_m, float(np.percentile(returns, 95)))
        if self.metres == 1.0:
            return scan, ""
        unit = "millimetres" if self.metres == MILLIMETRE_M else "centimetres"
        return _scaled(scan, self.metres), f"its ranges are in {unit}: converted to metres; {DRIVER}"


def _returns(ranges: NDArray[np.float32]) -> NDArray[np.float32]:
    """The (n,) ranges of beams that returned."""
    returns = ranges[np.isfinite(ranges) & (ranges > 0)]
    if len(returns) == 0:
        return returns
    largest = returns == returns.max()
    return returns[~largest] if int(largest.sum()) >= SAME_RETURNS else returns


def _unit_m(range_max: float, far_return: float) -> float:
    """The unit of ranges that cannot be metres, by the largest that is possible, or that 95 of 100 are less than."""
    limit, least = (range_max, LEAST_MM_LIMIT) if MOST_LIMIT_M < range_max < math.inf else (far_return, LEAST_MM_RETURN)
    return MILLIMETRE_M if limit >= least else CENTIMETRE_M


def _scaled(scan: LaserScan, metres: float) -> LaserScan:
    ranges = scan.ranges * np.float32(metres)
    if not scan.range_max_m > MOST_LIMIT_M:
        return replace(scan, ranges=ranges)
    return replace(scan, ranges=ranges, range_min_m=scan.range_min_m * metres, range_max_m=scan.range_max_m * metres)
