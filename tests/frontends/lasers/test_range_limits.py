"""Ranges and their limits in metres."""

import math

import numpy as np
import pytest

from wayfi.frontends.lasers.range_limits import RangeUnit, with_limits
from wayfi.frontends.measurements import LaserScan

ROOM = np.linspace(0.4, 9.0, 180, dtype=np.float32)


def scan(ranges: np.ndarray[tuple[int], np.dtype[np.float32]], low: float = 0.1, high: float = 30.0) -> LaserScan:
    return LaserScan(0, "laser", np.asarray(ranges, np.float32), -1.5, 0.017, low, high)


@pytest.mark.parametrize(
    ("low", "high", "used"),
    [
        (0.1, 30.0, (0.1, 30.0)),
        (0.1, math.inf, (0.1, math.inf)),
        (-1.0, 30.0, (0.0, 30.0)),
        (math.nan, 30.0, (0.0, 30.0)),
        (0.1, 0.0, (0.1, math.inf)),
        (0.1, -5.0, (0.1, math.inf)),
        (0.1, math.nan, (0.1, math.inf)),
        (30.0, 0.1, (0.1, 30.0)),
    ],
)
def test_limits_that_are_none_are_left_out(low: float, high: float, used: tuple[float, float]) -> None:
    found, fault = with_limits(scan(ROOM, low, high))
    assert (found.range_min_m, found.range_max_m) == used
    assert bool(fault) == (not high > 0 or low > high)


@pytest.mark.parametrize(
    ("factor", "high", "unit"),
    [
        (1000, 30_000.0, "millimetres"),
        (1000, 4000.0, "millimetres"),
        (1000, 12.0, "millimetres"),
        (1000, math.inf, "millimetres"),
        (100, 1200.0, "centimetres"),
        (100, 12.0, "centimetres"),
    ],
)
def test_ranges_of_another_unit_are_converted(factor: float, high: float, unit: str) -> None:
    found, fault = RangeUnit().check(scan(ROOM * factor, 0.1, high))
    np.testing.assert_allclose(found.ranges, ROOM, rtol=1e-5)
    assert unit in fault
    assert found.range_max_m == (high if high < 100 or high == math.inf else high / factor)


@pytest.mark.parametrize(
    "ranges", [ROOM, np.full(180, 65_535.0), np.r_[ROOM[:90], np.full(90, 1e6)], np.full(180, np.nan), ROOM[:0]]
)
def test_metres_stay_whatever_stands_for_no_return(ranges: np.ndarray[tuple[int], np.dtype[np.float32]]) -> None:
    found, fault = RangeUnit().check(scan(ranges, 0.1, 30_000.0))
    np.testing.assert_array_equal(found.ranges, np.asarray(ranges, np.float32))
    assert not fault


def test_a_near_wall_does_not_change_the_unit_back_but_metres_do() -> None:
    unit = RangeUnit()
    assert unit.check(scan(ROOM * 1000))[1]
    assert unit.check(scan(ROOM * 10))[1]  # 4 to 90 mm
    assert not unit.check(scan(ROOM))[1]
