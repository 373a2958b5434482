"""The wheels' calibration along the path: followed where scan matches show it change, kept where nothing does."""

import math

import numpy as np
import pytest
from graphs import PRIOR

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.calibration_chain import CalibrationChain
from wayfi.backend.graph.factors import BetweenFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2

CONFIG = BackendConfig()
STEP_M, STEPS = 0.5, 400
WHEELS, MATCH = np.diag([0.005**2, 0.005**2, 0.002**2]), np.diag([0.004**2, 0.004**2, 0.0015**2])
BEFORE, AFTER = 0.0, 0.02  # rad/m, the turn bias of either half of the drive


def bias(step: int) -> float:
    return BEFORE if step < STEPS // 2 else AFTER


def straight(matched: bool) -> PoseGraph:
    """A straight drive whose wheels begin to turn by themselves half way, with a scan match at each step or without."""
    rng, graph = np.random.default_rng(1), PoseGraph(CONFIG, PRIOR)
    graph.add_keyframe(Pose2())
    graph.update()
    for k in range(STEPS):
        told = Pose2(STEP_M, 0.0, rng.normal(0.0, 0.001) - bias(k) * STEP_M)
        motion = WheelMotion(told, STEP_M, 1.0)
        graph.add_keyframe(graph.pose(k) @ motion.corrected(graph.calibration_values()))
        graph.add(WheelFactor(k, k + 1, motion, WHEELS))
        if matched:
            graph.add(BetweenFactor(k, k + 1, Pose2(STEP_M, 0.0, rng.normal(0.0, 0.0003)), MATCH))
        graph.update()
    return graph


def test_a_turn_bias_that_changes_is_followed_where_scans_are_matched() -> None:
    graph = straight(matched=True)
    calibrations = graph.calibrations()
    assert len(calibrations) == int(STEP_M * STEPS / CONFIG.stretch_m) + 1
    third = len(calibrations) // 3
    assert all(abs(turn_left(c, BEFORE)) < 0.001 for c in calibrations[:third])
    assert all(abs(turn_left(c, AFTER)) < 0.001 for c in calibrations[-third:])


def turn_left(calibration: Floats, turn_bias: float) -> float:
    """What a calibration leaves of the turn that wheels with a bias measure on a straight metre, rad."""
    motion = WheelMotion(Pose2(STEP_M, 0.0, -turn_bias * STEP_M), STEP_M, 1.0)
    return motion.corrected(calibration).theta / STEP_M


def test_without_scan_matches_the_calibration_is_one() -> None:
    """Nothing shows a change: then one place that is reached again must not be explained by wheels that wander."""
    graph = straight(matched=False)
    assert np.ptp(graph.calibrations()[:, 2]) < 1e-6
    stretches = STEP_M * STEPS / CONFIG.stretch_m
    walked = CONFIG.unobserved_walk * CONFIG.walk_turn_bias_rad_per_m * math.sqrt(CONFIG.stretch_m * stretches)
    sigma = graph.calibration().sigmas[2]
    assert sigma == pytest.approx(math.hypot(PRIOR.sigmas[2], walked), rel=1e-3)


def test_the_stretch_is_that_of_the_path_that_the_wheels_drove() -> None:
    chain = CalibrationChain(CONFIG)
    factors = [WheelFactor(k, k + 1, WheelMotion(Pose2(4.0, 0.0, 0.0), 4.0, 1.0), WHEELS) for k in range(6)]
    chain.add_keyframe()
    for factor in factors:
        chain.add_keyframe()
        chain.add(factor)
    assert [chain.stretch(factor) for factor in factors] == [0, 0, 1, 1, 2, 2]
    assert chain.on_every_stretch(np.zeros(4), factors).shape == (3, 4)
    first = np.array([[0.0, 0.0, 0.01, 0.0], [0.0, 0.0, 0.02, 0.0]])
    np.testing.assert_array_equal(chain.on_every_stretch(first, factors)[:, 2], [0.01, 0.02, 0.02])


def test_motions_that_are_replaced_keep_the_solution_they_agree_with() -> None:
    graph = straight(matched=True)
    before = graph.poses()
    motions = [factor.motion for factor in graph.of_kind(WheelFactor)]
    graph.replace_motions(motions)
    assert graph.restarts
    graph.update()
    np.testing.assert_allclose(graph.poses(), before, atol=0.02)


def test_where_the_laser_falls_silent_the_calibration_walks_on_as_it_has_taught() -> None:
    """Else a drive into a dark hall would claim its heading by wheels that were seen to change."""
    still, quick = after_matches(rate=0.0), after_matches(rate=0.002)
    assert still == pytest.approx(CONFIG.walk_turn_bias_rad_per_m, rel=0.01)
    assert quick == pytest.approx(0.002, rel=0.33)


def after_matches(rate: float) -> float:
    """The rate at which the claimed variance of the turn bias grows, 30 m without matches after 200 m with them."""
    rng, graph, turn_bias = np.random.default_rng(4), PoseGraph(CONFIG, PRIOR), 0.0
    graph.add_keyframe(Pose2())
    graph.update()
    sigmas = []
    for k in range(STEPS + 60):
        turn_bias += rate * math.sqrt(STEP_M) * rng.normal()
        motion = WheelMotion(Pose2(STEP_M, 0.0, rng.normal(0.0, 0.002) - turn_bias * STEP_M), STEP_M, 1.0)
        graph.add_keyframe(Pose2(STEP_M * (k + 1), 0.0, 0.0))
        graph.add(WheelFactor(k, k + 1, motion, WHEELS))
        if k < STEPS:
            graph.add(BetweenFactor(k, k + 1, Pose2(STEP_M, 0.0, 0.0), MATCH))
        graph.update()
        if k >= STEPS:
            sigmas.append(graph.calibration().sigmas[2])
    return math.sqrt((sigmas[-1] ** 2 - sigmas[0] ** 2) / (STEP_M * len(sigmas)))
