"""A scan's bearings: what its numbers say, and what is wrong with them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfi.frontends.lasers.bearings import BearingsCheck, bearings_of
from wayfi.frontends.measurements import LaserScan

FLOATS = st.floats(width=32) | st.floats(-8, 8, width=32)


def scan(start: float, step: float, end: float | None, beams: int = 360, ranges_m: float = 2.0) -> LaserScan:
    ranges = np.full(beams, ranges_m, np.float32)
    return LaserScan(0, "laser", ranges, start, step, 0.1, 30.0, angle_max=end)


@given(st.floats(-3, 3), st.floats(0.001, 0.017), st.booleans(), st.integers(30, 360), st.integers(-2, 2))
def test_numbers_that_agree_are_left_as_they_are(
    start: float, step: float, clockwise: bool, beams: int, off: int
) -> None:
    step = -step if clockwise else step
    end = start + (beams - 1 + off) * step
    found = bearings_of(scan(start, step, end, beams))
    assert (found.start, found.step, found.fault) == (start, step, "")


def test_a_part_of_a_turn_may_go_across_the_rear() -> None:
    found = bearings_of(scan(math.radians(225), math.radians(1.0), math.radians(134), 270))
    assert not found.fault


@given(FLOATS, FLOATS, FLOATS, st.integers(0, 400))
def test_any_numbers_give_bearings_of_a_turn_at_most_or_none_and_a_fault(
    start: float, step: float, end: float, beams: int
) -> None:
    found = bearings_of(scan(start, step, end, beams))
    if found.step is None:
        assert found.fault
    elif beams > 1:
        assert 0 < abs(found.step) * (beams - 1) < 2.2 * math.pi + 4 * abs(found.step)
        assert math.isfinite(found.start)


@pytest.mark.parametrize(
    ("start", "step", "end", "read"),
    [
        (-math.pi, 0.0, math.pi, 2 * math.pi / 359),
        (-math.pi, math.nan, math.pi, 2 * math.pi / 359),
        (-math.pi, 1.0, math.pi, math.radians(1.0)),
        (-180.0, 1.0, 179.0, math.radians(1.0)),
        (-180.0, math.radians(1.0), 179.0, math.radians(1.0)),
        (-math.pi, 1.0, None, math.radians(1.0)),
        (-math.pi, 1.0, 0.0, math.radians(1.0)),
        (math.pi, -1.0, -math.pi, math.radians(-1.0)),
        (-math.pi, 1e-9, math.pi, 2 * math.pi / 359),
    ],
)
def test_a_number_that_cannot_be_right_is_corrected(start: float, step: float, end: float | None, read: float) -> None:
    found = bearings_of(scan(start, step, end))
    assert found.step == pytest.approx(read, rel=0.01)
    assert abs(found.start) == pytest.approx(math.pi)
    assert found.fault


@pytest.mark.parametrize("start", [-3.0, 0.5, 1.0, 2.0])
def test_an_angle_max_that_is_a_turn_off_in_a_fragment_leaves_its_beginning(start: float) -> None:
    found = bearings_of(scan(start, 0.03, start + 6.28, 36))
    assert (found.start, found.step) == (start, 0.03)


def test_a_narrow_view_in_degrees_is_converted() -> None:
    found = bearings_of(scan(-10.0, math.radians(0.5), 10.0, 41))
    assert found.start == pytest.approx(math.radians(-10.0))
    assert "degrees" in found.fault


@pytest.mark.parametrize(
    ("start", "step", "end"),
    [
        (-math.pi, 0.0, -math.pi),
        (-math.pi, 0.0, None),
        (-math.pi, 0.04, 359 * 0.04 - math.pi),
        (math.nan, 0.01, 1.0),
        (1e9, 0.01, 1.0),
        (0.0, math.inf, 0.0),
    ],
)
def test_what_says_nothing_possible_has_no_bearings(start: float, step: float, end: float | None) -> None:
    found = bearings_of(scan(start, step, end))
    assert found.step is None
    assert "its scans are not used" in found.fault


def room(number: int, step: float, stated: float) -> LaserScan:
    """A room of 8 x 6 m from somewhere in it, seen with one step between beams and said to be seen with another."""
    rng = np.random.default_rng(number)
    (x, y), bearings = rng.uniform(-1.5, 1.5, 2), step * np.arange(360) - math.pi
    c, s = np.cos(bearings + 0.3 + number), np.sin(bearings + 0.3 + number)
    ranges = np.minimum(np.where(c > 0, 4 - x, 4 + x) / np.abs(c), np.where(s > 0, 3 - y, 3 + y) / np.abs(s))
    ranges += 0.01 * rng.standard_normal(360)
    end = -math.pi + 359 * math.radians(1.0)
    return LaserScan(0, "laser", ranges.astype(np.float32), -math.pi, stated, 0.1, 30.0, angle_max=end)


@pytest.mark.parametrize("factor", [0.5, 0.8])
def test_walls_tell_which_of_two_steps_is_right(factor: float) -> None:
    right, wrong = math.radians(1.0), factor * math.radians(1.0)
    for seen, expected in ((right, right), (wrong, wrong)):
        check, scans = BearingsCheck(), [room(number, seen, wrong) for number in range(60)]
        used = [checked for scan in scans if (checked := check.check(scan)[0]) is not None]
        assert len(used) > 40
        assert {round(scan.angle_increment / expected, 2) for scan in used} == {1.0}


def test_steps_that_mirror_each_other_make_the_same_walls_so_that_the_increment_is_believed() -> None:
    for mirrored in (scan(0.2, -0.01, 0.2 + 3.0, 301), scan(math.pi, math.radians(1.0), -math.pi)):
        assert "angle_increment is believed" in BearingsCheck().check(mirrored)[1]
