"""How long a sweep takes, by its own numbers and by the stamps between scans."""

import math

import numpy as np
import pytest

from wayfi.frontends.lasers.sweep_time import SweepTime
from wayfi.frontends.measurements import LaserScan

BEAMS = 200


def sweeps(each_s: float, scan_time_s: float | None = None, period_s: float = 0.1, turn: float = 1.0) -> list[float]:
    """What is used of ten scans: the sweep's time, s, of each; 10 more for those of which something is told."""
    check, used = SweepTime(), []
    for number in range(10):
        stamp_ns, step = round(number * period_s * 1e9), turn * 2 * math.pi / BEAMS
        ranges = np.ones(BEAMS, np.float32)
        scan = LaserScan(stamp_ns, "laser", ranges, 0.0, step, 0.1, 30.0, each_s, scan_time_s=scan_time_s)
        found, fault = check.check(scan)
        used.append(found.time_increment_s * BEAMS + 10.0 * bool(fault))
    return used


@pytest.mark.parametrize("each_s", [0.0, 0.0001, 0.0005, 0.00055, -0.0005])
def test_a_sweep_no_longer_than_the_time_between_scans_is_left(each_s: float) -> None:
    assert sweeps(each_s) == pytest.approx([BEAMS * each_s] * 10)


@pytest.mark.parametrize(
    ("each_s", "used_s"), [(0.1, 0.1), (0.5, 0.1), (500.0, 0.1), (5e5, 0.1), (0.09, 0.09), (0.007, 0.1)]
)
def test_a_longer_one_is_the_whole_sweeps_or_of_another_unit_or_takes_its_turn(each_s: float, used_s: float) -> None:
    assert sweeps(each_s)[3:] == pytest.approx([10 + used_s] * 7)
    assert sweeps(each_s, scan_time_s=0.1) == pytest.approx([10 + used_s] * 10)


def test_half_a_turn_takes_half_of_the_time() -> None:
    assert sweeps(0.01, turn=0.5)[3:] == pytest.approx([10.05] * 7)


def test_a_time_increment_that_is_no_number_is_unknown() -> None:
    assert sweeps(math.nan) == sweeps(math.inf) == [0.0] * 10
