"""Sweeps of several lasers: each set holds one of every laser that sends."""

import numpy as np
import pytest

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.intake.sweep_sets import SweepSet, SweepSets
from wayfi.frontends.measurements import LaserScan
from wayfi.frontends.odometry.driven_path import PathPoint

MS = 1_000_000


def sets(*arrivals: tuple[str, int], restart_ms: int = 10**9) -> list[list[tuple[str, int]]]:
    """The sets of lasers' sweeps, each at so many ms; the odometry begins anew at `restart_ms`."""
    collecting, out = SweepSets(), []
    for laser, ms in arrivals:
        point = PathPoint(ms * MS, Pose2(), 0.0, int(ms >= restart_ms))
        out += collecting.add(laser, point, LaserScan(ms * MS, laser, np.ones(3, np.float32), 0.0, 0.1, 0.1, 30.0))
    return [named(s) for s in out]


def named(found: SweepSet) -> list[tuple[str, int]]:
    return [(sweep.frame_id, point.stamp_ns // MS) for point, sweep in found.members]


def steady(laser: str, period: int, phase: int = 0, until: int = 2000) -> list[tuple[str, int]]:
    return [(laser, ms) for ms in range(phase, until, period)]


def in_order(*lasers: list[tuple[str, int]]) -> list[tuple[str, int]]:
    return sorted((arrival for laser in lasers for arrival in laser), key=lambda arrival: arrival[1])


def test_of_a_lone_laser_every_sweep_is_a_set_at_once() -> None:
    assert sets(*steady("a", 100)) == [[arrival] for arrival in steady("a", 100)]


@pytest.mark.parametrize("phase", [0, 10, 50, 74, 90])
def test_two_lasers_are_paired_with_what_is_nearest(phase: int) -> None:
    found = sets(*in_order(steady("a", 100), steady("b", 100, phase)))[3:]
    assert len(found) >= 15
    assert all(len(pair) == 2 for pair in found)
    assert all(abs(b - a) <= 75 for (_, a), (_, b) in found)


def test_a_fast_laser_does_not_wait_for_a_slow_one_for_long() -> None:
    found = sets(*in_order(steady("fast", 50), steady("slow", 250, 20)))
    assert sum(len(each) == 2 for each in found) == 8
    assert sum(("fast", ms) in each for each in found for ms in range(0, 2000, 50)) >= 30


def test_a_laser_that_falls_silent_is_waited_for_no_longer_than_a_second() -> None:
    found = sets(*in_order(steady("a", 100, until=5000), steady("b", 100, until=1000)))
    assert found[-30:] == [[arrival] for arrival in steady("a", 100, until=5000)[-30:]]


def test_sweeps_before_and_after_a_restart_of_the_odometry_are_not_joined() -> None:
    found = sets(*in_order(steady("a", 100), steady("b", 100, 40)), restart_ms=520)
    assert all(not a < 520 <= b for pair in found if len(pair) == 2 for (_, a), (_, b) in [pair])
