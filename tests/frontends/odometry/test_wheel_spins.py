"""Wheels that spin: what the laser taught of them holds where it sees nothing, and a closure bends the path there."""

from itertools import accumulate

import numpy as np
import pytest
from graphs import PRIOR

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import BetweenFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.wheel_noise import wheel_covariance
from wayfi.frontends.odometry.wheel_spins import WheelSpins, WheelStep, doubt_spun, wheel_step

CONFIG = OdometryConfig()
STEP_S, CRUISE_M = 1.0, 0.5
CRUISE = [CRUISE_M] * 14
FASTER = [0.6, 0.65, 0.6]
EXCESS_M = sum(FASTER) - len(FASTER) * CRUISE_M


def doubted(ways_m: list[float], denied_m: list[float], seen: list[float]) -> dict[int, float]:
    """The variance (m^2) that each doubtful step of a straight drive gets, by its number."""
    spins, found = WheelSpins(CONFIG), {}
    for k, (way_m, less_m, sure) in enumerate(zip(ways_m, denied_m, seen, strict=True)):
        step = WheelStep(k, WheelMotion(Pose2(way_m, 0.0, 0.0), way_m, STEP_S), denied_m=less_m, seen=sure)
        found.update({d.number: float(d.covariance[0, 0]) for d in spins.add(step)})
    return found


def twice_faster(denied: bool) -> dict[int, float]:
    """A drive that is faster twice: first where the laser sees the way, and `denied` it or not; then unseen."""
    ways_m = [*CRUISE, *FASTER, *CRUISE, *FASTER, *CRUISE]
    sees = [1.0] * (2 * len(CRUISE) + len(FASTER)) + [0.0] * (len(CRUISE) + len(FASTER))
    return doubted(ways_m, [(way_m - CRUISE_M) * sure * denied for way_m, sure in zip(ways_m, sees, strict=True)], sees)


def test_an_unseen_spin_is_doubted_after_a_seen_one() -> None:
    first, second = len(CRUISE), 2 * len(CRUISE) + len(FASTER)
    found = twice_faster(denied=True)
    assert set(found) == {*range(first, first + 3), *range(second, second + 3)}
    unseen = sum(variance for number, variance in found.items() if number >= second)
    assert 0.8 * EXCESS_M**2 < unseen < EXCESS_M**2  # of their sum, which is one error


def test_a_seen_spin_tells_of_an_unseen_one_before_it() -> None:
    ways_m, unseen = [*CRUISE, *FASTER, *CRUISE, *FASTER, *CRUISE], len(CRUISE) + len(FASTER)
    sees = [0.0] * unseen + [1.0] * (len(ways_m) - unseen)
    found = doubted(ways_m, [(way_m - CRUISE_M) * sure for way_m, sure in zip(ways_m, sees, strict=True)], sees)
    assert set(range(len(CRUISE), unseen)) < set(found)


def test_a_robot_that_was_seen_to_speed_up_is_believed() -> None:
    assert twice_faster(denied=False) == {}


def test_what_scan_matches_err_by_denies_no_change_of_speed() -> None:
    ways_m = [*CRUISE, *(20 * [*CRUISE, 0.65]), *CRUISE]
    denied_m = [0.015 if way_m > CRUISE_M else 0.0 for way_m in ways_m]
    assert doubted(ways_m, denied_m, [1.0] * len(ways_m)) == {}


def test_the_wheels_noise_is_no_spin() -> None:
    rng, first = np.random.default_rng(0), len(CRUISE)
    steady = [m + rng.normal(0.0, 0.01) for m in 40 * CRUISE]
    ways_m = [*CRUISE, *FASTER, *steady]
    sees = [1.0] * (first + len(FASTER)) + [0.0] * len(steady)
    found = doubted(ways_m, [(way_m - CRUISE_M) * sure for way_m, sure in zip(ways_m, sees, strict=True)], sees)
    assert set(found) == {*range(first, first + len(FASTER))}


def test_hints_of_spins_do_not_add_up() -> None:
    ways_m = [*CRUISE, *(40 * [*CRUISE, 0.55]), *CRUISE, 0.65, *CRUISE]
    denied_m = [0.04 if way_m == 0.55 else 0.0 for way_m in ways_m]
    assert doubted(ways_m, denied_m, [0.0 if way_m == 0.65 else 1.0 for way_m in ways_m]) == {}


def test_without_a_laser_nothing_is_doubted() -> None:
    ways_m = [*CRUISE, *FASTER, *CRUISE, *FASTER, *CRUISE]
    assert doubted(ways_m, [0.0] * len(ways_m), [0.0] * len(ways_m)) == {}


@pytest.mark.parametrize("ways_m", [[0.01, 0.2, *CRUISE], [*CRUISE, 0.2, 0.01], [*CRUISE, 0.0, 0.0], [0.3] * 14])
def test_starts_stops_and_other_speeds_are_no_spins(ways_m: list[float]) -> None:
    before, after = [*CRUISE, *FASTER, *CRUISE], [*CRUISE, *CRUISE]
    drive = [*before, *ways_m, *after]
    denied_m = [way_m - CRUISE_M for way_m in before] + [0.0] * (len(drive) - len(before))
    seen = [1.0] * len(before) + [0.0] * (len(drive) - len(before))
    assert set(doubted(drive, denied_m, seen)) == set(range(len(CRUISE), len(CRUISE) + len(FASTER)))


def test_what_a_match_denies_is_along_the_way() -> None:
    motion = WheelMotion(Pose2(0.0, 0.6, 0.1), 0.6, STEP_S)
    wheels = WheelFactor(0, 1, motion, np.diag([0.01**2, 0.02**2, 0.01**2]))
    open_along = BetweenFactor(0, 1, Pose2(0.1, 0.5, 0.1), np.diag([0.002**2, 1.0, 0.001**2]))
    sure = BetweenFactor(0, 1, Pose2(0.1, 0.5, 0.1), np.diag([1.0, 0.002**2, 0.001**2]))
    assert wheel_step(1, wheels, motion.pose, sure, 1.0).denied_m == pytest.approx(0.1)
    assert wheel_step(1, wheels, motion.pose, sure, 1.0).seen > 0.98
    assert wheel_step(1, wheels, motion.pose, open_along, 1.0).seen < 0.01
    assert wheel_step(1, wheels, motion.pose, None, 1.0).seen == 0.0


def worst_m(doubts: bool) -> float:
    """How far a pose is off at worst, in a smooth aisle that ends at a place known before; the wheels spin within."""
    rng = np.random.default_rng(0)
    true_m = [CRUISE_M] * 120
    faster = dict.fromkeys((20, 21, 22, 90, 91, 92), 0.15)
    told_m = [m + faster.get(k, 0.0) + rng.normal(0.0, 0.007) for k, m in enumerate(true_m)]
    graph, spins = PoseGraph(BackendConfig(), PRIOR), WheelSpins(CONFIG)
    for x_m in accumulate(told_m, initial=0.0):
        graph.add_keyframe(Pose2(x_m, 0.0, 0.0))
    for k, (true, told) in enumerate(zip(true_m, told_m, strict=True)):
        motion = WheelMotion(Pose2(told, 0.0, 0.0), told, STEP_S)
        wheels = WheelFactor(k, k + 1, motion, wheel_covariance(motion, CONFIG))
        match = BetweenFactor(k, k + 1, Pose2(true, 0.0, 0.0), diagonal(0.003 if k < 40 else 1.0))
        number = graph.add(wheels)
        graph.add(match)
        doubtful = spins.add(wheel_step(number, wheels, motion.pose, match, 1.0))
        doubt_spun(graph, doubtful if doubts else [])
    graph.add(BetweenFactor(0, len(true_m), Pose2(sum(true_m), 0.0, 0.0), diagonal(0.02)))
    graph.settle()
    return float(np.abs(graph.poses()[:, 0] - list(accumulate(true_m, initial=0.0))).max())


def diagonal(along_m: float) -> Floats:
    """The covariance of a place that is known to `along_m` along the way, and well across it."""
    return np.diag([along_m**2, 0.003**2, 0.001**2])


def test_a_closure_is_bent_to_where_the_wheels_spun() -> None:
    assert worst_m(doubts=False) > 0.2
    assert worst_m(doubts=True) < 0.1
