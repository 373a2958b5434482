"""The fragments of a turn, by their first bearings."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfi.frontends.lasers.fragments import Fragments
from wayfi.frontends.measurements import SECOND_NS, LaserScan

TURN_NS = 100_000_000
STEP = 2 * math.pi / 360


def fragments(pieces: int, turns: int, view: int = 360, sign: int = 1) -> Iterator[LaserScan]:
    """Turns of `view` degrees, beam i of each i metres away, in as many pieces."""
    size = view // pieces
    for number in range(turns * pieces):
        turn, piece = divmod(number, pieces)
        stamp_ns = SECOND_NS + turn * TURN_NS + piece * size * TURN_NS // 360
        ranges = np.arange(piece * size, (piece + 1) * size, dtype=np.float32) + 1
        begin = sign * (piece * size * STEP) - 1.0
        yield LaserScan(stamp_ns, "laser", ranges, begin, sign * STEP, 0.1, 1000.0)


@given(st.sampled_from([2, 3, 4, 9, 12, 30]), st.sampled_from([360, 270, 180]), st.sampled_from([1, -1]))
def test_each_turn_is_one_scan_deskewed_by_its_stamps(pieces: int, view: int, sign: int) -> None:
    joining = Fragments()
    out = [scan for piece in fragments(pieces, 6, view, sign) for scan in joining.add(piece)] + joining.finish()
    whole = [scan for scan in out if len(scan.ranges) > 0.9 * view]
    assert len(whole) >= 4
    for scan in whole[-3:-1]:
        seen = np.flatnonzero(np.isfinite(scan.ranges))
        bearings = scan.angle_min + seen * scan.angle_increment
        expected = np.mod(sign * (bearings + 1.0) / STEP + 0.01, 360)
        np.testing.assert_allclose(scan.ranges[seen], np.floor(expected) + 1)
        assert scan.time_increment_s == pytest.approx(TURN_NS * 1e-9 / 360, rel=0.01)


@pytest.mark.parametrize("pieces", [1, 12])
def test_no_beam_is_lost_or_used_twice(pieces: int) -> None:
    joining = Fragments()
    out = [scan for piece in fragments(pieces, 5) for scan in joining.add(piece)] + joining.finish()
    assert sum(int(np.isfinite(scan.ranges).sum()) for scan in out) == 5 * 360


@pytest.mark.parametrize(
    "walk",
    [
        lambda _: 0.0,  # a scanner that looks ahead
        lambda k: 0.02 * (k % 2),  # its motor does not stop at the same beam
        lambda k: 0.3 * k,  # it is turned, but not by what it covers
        lambda k: 1.0 * (k % 2),  # two of them in one frame, side by side but apart
    ],
)
def test_a_scanner_of_30_degrees_is_whole(walk: object) -> None:
    joining = Fragments()
    for k in range(50):
        scan = LaserScan(k * TURN_NS, "laser", np.ones(30, np.float32), walk(k), STEP, 0.1, 30.0)  # type: ignore[operator]
        assert joining.add(scan) == [scan]


def test_a_pause_within_a_turn_ends_it_and_little_is_held() -> None:
    joining, out = Fragments(), []
    pieces = list(fragments(12, 3))[:-6]
    late = [LaserScan(p.stamp_ns + 9 * SECOND_NS, "laser", p.ranges, p.angle_min, STEP, 0.1, 30.0) for p in pieces]
    for piece in [*pieces, *late]:
        out += joining.add(piece)
    assert sum(int(np.isfinite(scan.ranges).sum()) for scan in out + joining.finish()) == 2 * 30 * 30
    assert max(scan.time_increment_s for scan in out) < 0.01


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-0.5, 0.5), st.integers(0, 40), st.integers(0, 3)), max_size=60))
def test_any_scans_go_through_and_none_is_larger_than_a_turn(scans: list[tuple[float, float, int, int]]) -> None:
    joining, out, beams = Fragments(), [], 0
    for number, (begin, step, count, late) in enumerate(scans):
        stamp_ns = (number + late) * 10_000_000
        out += joining.add(LaserScan(stamp_ns, "laser", np.ones(count, np.float32), begin, step, 0.1, 30.0))
        beams += count
    out += joining.finish()
    assert sum(int(np.isfinite(scan.ranges).sum()) for scan in out) <= beams
    assert all(scan.time_increment_s >= 0 for scan in out)


@given(st.floats(-9, 9), st.floats(-1, 1) | st.sampled_from([0.0, 1e-308]), st.integers(0, 500))
def test_any_scan_may_come_between_fragments(begin: float, step: float, count: int) -> None:
    joining, odd, out = Fragments(), np.ones(count, np.float32), []
    for number, piece in enumerate(fragments(12, 4)):
        out += joining.add(piece)
        if number % 7 == 6:
            out += joining.add(LaserScan(piece.stamp_ns, "laser", odd, begin, step, 0.1, 30.0))
    assert max(len(scan.ranges) for scan in out + joining.finish()) <= 500 + 360
