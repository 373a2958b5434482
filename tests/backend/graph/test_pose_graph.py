"""The pose graph against analytic chains, sampled drives and itself: nothing that is fed to it may harm it."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import BetweenFactor, Factor, FactorError, NearFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelCalibration, WheelMotion
from wayfi.backend.pose2 import Floats, Pose2, adjoint, between_all, compose_all, wrap
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior

PRIOR = calibration_prior(OdometryConfig())
STEP = np.diag([0.02**2, 0.01**2, 0.01**2])
CLOSURE = np.diag([0.05**2, 0.05**2, 0.02**2])


def chain(steps: list[Pose2], covariance: Floats = STEP) -> PoseGraph:
    """A graph of relative poses, one behind the other."""
    graph = PoseGraph(BackendConfig(), PRIOR)
    T = Pose2()
    graph.add_keyframe(T)
    for k, step in enumerate(steps):
        T = T @ step
        graph.add_keyframe(T)
        graph.add(BetweenFactor(k, k + 1, step, covariance))
    graph.update()
    return graph


ARC = [Pose2(0.5, 0.02 * k, 0.15) for k in range(10)]


@dataclass(frozen=True, slots=True, eq=False)
class Loops:
    """A drive in rounds: the truth (n + 1, 3) and what wheels of `calibration` said of each step."""

    truth: list[Pose2]
    motions: list[WheelMotion]


def loops(calibration: Floats, rounds: int, per_round: int = 80, seed: int = 0, noise: float = 1.0) -> Loops:
    """Rounds of a figure of eight, an oval to the left and one to the right, in steps of half a metre.

    Wheels err by `calibration`, and at random by 1 mm and 0.2 degrees a step.
    """
    rng = np.random.default_rng(seed)
    truth, motions = [Pose2()], []
    for k in range(rounds * per_round):
        quarter = 8 * (k % per_round) // per_round
        turn = 8 * math.pi / per_round * (1 if quarter < 4 else -1) * (quarter % 2)
        true = Pose2(0.5 * math.cos(turn / 2), 0.5 * math.sin(turn / 2), turn)
        truth.append(truth[-1] @ true)
        scale, turn_scale, per_m, _ = calibration
        told = (turn - per_m * 0.5) / (1 + turn_scale)
        length, extra = 0.5 / (1 + scale), turn - told
        x, y, theta = noise * rng.normal(0, [0.001, 0.001, 0.0035])
        said = Pose2(
            length * math.cos(turn / 2 - extra / 2) + x, length * math.sin(turn / 2 - extra / 2) + y, told + theta
        )
        motions.append(WheelMotion(said, 0.5, 1.0))
    return Loops(truth, motions)


WHEELS = np.diag([0.002**2, 0.002**2, 0.0035**2])


def drive(graph: PoseGraph, drive: Loops, closures: dict[int, int], covariance: Floats = CLOSURE) -> None:
    """Feed a drive as the pipeline does; `closures` maps a keyframe to the earlier one that it is related to."""
    graph.add_keyframe(Pose2())
    graph.update()
    for k, motion in enumerate(drive.motions):
        graph.add_keyframe(graph.pose(k) @ motion.corrected(graph.calibration_values()))
        graph.add(WheelFactor(k, k + 1, motion, WHEELS))
        if (a := closures.get(k + 1)) is not None:
            graph.add(BetweenFactor(a, k + 1, drive.truth[a].between(drive.truth[k + 1]), covariance))
        graph.update()


def errors_m(graph: PoseGraph, truth: list[Pose2]) -> Floats:
    return np.array([graph.pose(k).distance(T) for k, T in enumerate(truth)])


# What may not enter

BAD_COVARIANCES = {
    "asymmetric": np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    "symmetric 3 x 3": np.eye(2),
    "positive definite": np.diag([1.0, -1.0, 1.0]),
    "definite": np.diag([1.0, 1.0, 0.0]),
    "finite": np.diag([1.0, math.nan, 1.0]),
    "must be finite": np.diag([1.0, math.inf, 1.0]),
}
MOTION = WheelMotion(Pose2(0.5, 0.0, 0.1), 0.5, 1.0)
BAD_FACTORS: dict[str, Factor] = {
    "x is NaN": BetweenFactor(0, 5, Pose2(math.nan, 0.0, 0.0), STEP),
    "theta is infinite": BetweenFactor(0, 5, Pose2(0.0, 0.0, math.inf), STEP),
    "no such keyframe": BetweenFactor(0, 11, Pose2(), STEP),
    "a negative keyframe": BetweenFactor(-1, 5, Pose2(), STEP),
    "a keyframe with itself": BetweenFactor(5, 5, Pose2(), STEP),
    "wheels without a pose": WheelFactor(0, 1, WheelMotion(Pose2(math.nan, 0.0, 0.0), 0.5, 1.0), STEP),
    "wheels without a path": WheelFactor(0, 1, WheelMotion(Pose2(), math.nan, 1.0), STEP),
    "wheels without a time": WheelFactor(0, 1, WheelMotion(Pose2(), 0.5, math.inf), STEP),
    "wheels to nowhere": WheelFactor(10, 11, MOTION, STEP),
    "a place that is NaN": NearFactor(0, 5, np.array([math.nan, 0.0]), np.zeros(2), 1.0),
    "a place to no keyframe": NearFactor(0, 11, np.zeros(2), np.zeros(2), 1.0),
    "a place known to nothing": NearFactor(0, 5, np.zeros(2), np.zeros(2), 0.0),
    "a place known to infinity": NearFactor(0, 5, np.zeros(2), np.zeros(2), math.inf),
} | {f"covariance not {name}": BetweenFactor(0, 5, Pose2(), bad) for name, bad in BAD_COVARIANCES.items()}


@pytest.mark.parametrize("factor", BAD_FACTORS.values(), ids=BAD_FACTORS.keys())
def test_a_factor_that_would_poison_the_graph_is_refused_and_leaves_it_as_it_was(factor: Factor) -> None:
    graph = chain(ARC)
    before, factors = graph.poses(), graph.factors()
    with pytest.raises(FactorError, match=rf"{type(factor).__name__} {factor.a} -> {factor.b}: "):
        graph.add(factor)
    assert graph.factors() == factors
    assert graph.update().added == 0
    np.testing.assert_array_equal(graph.poses(), before)
    good = graph.pose(0).between(graph.pose(10))
    graph.add(BetweenFactor(0, 10, good, STEP))
    graph.update()
    np.testing.assert_allclose(graph.poses(), before, atol=1e-9)


@pytest.mark.parametrize("guess", [Pose2(math.nan, 0, 0), Pose2(0, math.inf, 0), Pose2(0, 0, math.nan)], ids=str)
def test_a_keyframe_without_a_finite_guess_is_refused(guess: Pose2) -> None:
    graph = chain(ARC)
    with pytest.raises(FactorError, match="first guess of keyframe 11 is not finite"):
        graph.add_keyframe(guess)
    assert graph.keyframes == 11
    assert graph.update().factors == 10


def test_what_is_not_in_the_graph_cannot_be_removed() -> None:
    with pytest.raises(FactorError, match="no factor 99"):
        chain(ARC).remove(99)


# The estimate and its covariances


def test_a_chain_without_closures_is_where_its_steps_lead() -> None:
    graph, T = chain(ARC), Pose2()
    for k, step in enumerate(ARC):
        T = T @ step
        np.testing.assert_allclose(graph.pose(k + 1).array(), T.array(), atol=1e-6)
    np.testing.assert_allclose(graph.poses()[-1], T.array(), atol=1e-6)


def analytic(steps: list[Pose2]) -> Floats:
    """(3, 3) covariance of the chain of `steps`, in (x, y, theta) of its start, to first order."""
    covariance, T = np.zeros((3, 3)), Pose2()
    for step in steps:
        after = T @ step
        J = np.array([[1.0, 0.0, -(after.y - T.y)], [0.0, 1.0, after.x - T.x], [0.0, 0.0, 1.0]])
        R = adjoint(Pose2(0.0, 0.0, T.theta))
        covariance, T = J @ covariance @ J.T + R @ STEP @ R.T, after
    return covariance


def test_the_covariance_of_a_chain_is_that_of_its_steps() -> None:
    graph = chain(ARC)
    np.testing.assert_allclose(graph.covariance(10), analytic(ARC), rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(graph.relative_covariance(3, 8), analytic(ARC[3:8]), rtol=1e-3, atol=1e-6)


def test_the_covariance_of_a_chain_is_the_spread_of_drives_sampled_from_it() -> None:
    rng = np.random.default_rng(5)
    ends = []
    for _ in range(3000):
        T = Pose2()
        for step, e in zip(ARC[3:8], rng.multivariate_normal(np.zeros(3), STEP, 5), strict=True):
            T = T @ Pose2(step.x + e[0], step.y + e[1], step.theta + e[2])
        ends.append(T.array())
    claimed, seen = chain(ARC).relative_covariance(3, 8), np.cov(np.array(ends).T)
    sigma = np.sqrt(np.diag(claimed))
    np.testing.assert_allclose(seen / np.outer(sigma, sigma), claimed / np.outer(sigma, sigma), atol=0.1)


def test_a_relative_covariance_holds_in_both_directions() -> None:
    graph = chain(ARC)
    T_a_b = graph.pose(2).between(graph.pose(9))
    forward, backward = graph.relative_covariance(2, 9), graph.relative_covariance(9, 2)
    # T_b_a moves by -R(-theta) (d - [...]) when T_a_b moves by d: the inverse's Jacobian
    c, s = math.cos(T_a_b.theta), math.sin(T_a_b.theta)
    T_b_a = T_a_b.inverse()
    J = np.array([[-c, -s, T_b_a.y], [s, -c, -T_b_a.x], [0.0, 0.0, -1.0]])
    np.testing.assert_allclose(backward, J @ forward @ J.T, rtol=1e-6, atol=1e-9)


def test_the_wheels_systematic_errors_are_part_of_what_is_not_known() -> None:
    graph = PoseGraph(BackendConfig(), PRIOR)
    drive(graph, loops(np.zeros(4), 1, noise=0.0), {})
    sigma_theta = math.sqrt(graph.covariance(80)[2, 2])
    steps = math.sqrt(80) * 0.0035
    systematic = PRIOR.sigmas[2] * 40.0, PRIOR.sigmas[3] * 80.0
    assert sigma_theta == pytest.approx(math.hypot(steps, *systematic), rel=0.02)


# Adding and taking back


def test_removing_a_closure_brings_the_estimate_back() -> None:
    graph = chain(ARC)
    before = graph.poses()
    T = graph.pose(0).between(graph.pose(10))
    number = graph.add(BetweenFactor(0, 10, Pose2(T.x + 0.2, T.y - 0.1, T.theta), CLOSURE))
    assert graph.pending
    assert graph.update().added == 1
    assert np.abs(graph.poses() - before).max() > 0.02
    graph.remove(number)
    assert graph.pending
    assert graph.update().removed == 1
    graph.settle()
    np.testing.assert_allclose(graph.poses(), before, atol=1e-3)
    assert not graph.pending
    assert number not in graph.factors()


def test_a_queued_closure_that_is_removed_never_enters() -> None:
    graph = chain(ARC)
    before = graph.poses()
    graph.remove(graph.add(BetweenFactor(0, 10, Pose2(1.0, 1.0, 1.0), CLOSURE)))
    assert graph.update().added == 0
    np.testing.assert_array_equal(graph.poses(), before)


def test_slots_that_are_used_again_are_not_mixed_up() -> None:
    graph = chain(ARC)
    before = graph.poses()
    T = graph.pose(0).between(graph.pose(10))
    numbers = [graph.add(BetweenFactor(0, 10, Pose2(T.x + 0.1 * k, T.y, T.theta), CLOSURE)) for k in range(4)]
    graph.update()
    for number in numbers[:2]:
        graph.remove(number)
    graph.update()
    numbers[:2] = [graph.add(BetweenFactor(1, 9, graph.pose(1).between(graph.pose(9)), CLOSURE)) for _ in range(2)]
    graph.update()
    for number in numbers:
        graph.remove(number)
    graph.settle()
    np.testing.assert_allclose(graph.poses(), before, atol=3e-3)


# A drive in rounds


def test_the_turning_of_the_wheels_is_recovered_from_closures() -> None:
    """Their scale of distance is not: a smaller map closes as well, and its sigma says so."""
    truth = np.array([0.008, 0.02, 0.026, 0.0])
    recorded = loops(truth, 3)
    graph = PoseGraph(BackendConfig(), PRIOR)
    drive(graph, recorded, {k: k - 80 for k in range(80, 240, 10)})
    graph.settle()
    found = graph.calibration()
    assert abs(found.values[1] - truth[1]) < 0.008
    assert abs(found.values[2] - truth[2]) < 0.004
    assert (np.abs(found.values - truth) < 4 * found.sigmas).all()
    assert (found.sigmas[1:3] < PRIOR.sigmas[1:3] / 5).all()
    assert found.sigmas[0] > 0.9 * PRIOR.sigmas[0]
    assert errors_m(graph, recorded.truth).max() < 0.2


def test_a_closure_far_off_is_optimised_anew_and_converges() -> None:
    recorded = loops(np.array([0.0, 0.0, 0.03, 0.0]), 1)
    graph = PoseGraph(BackendConfig(), PRIOR)
    drive(graph, recorded, {})
    assert errors_m(graph, recorded.truth)[-1] > 2.0
    for a in (0, 1):
        graph.add(BetweenFactor(a, 80 - a, recorded.truth[a].between(recorded.truth[80 - a]), CLOSURE))
    graph.update()
    assert errors_m(graph, recorded.truth).max() < 0.3
    assert abs(graph.calibration().values[2] - 0.03) < 0.01


def test_a_closure_far_off_converges_where_no_wheels_are() -> None:
    bent = [Pose2(1.0, 0.0, 2 * math.pi / 60 + 0.02)] * 60
    graph = chain(bent)
    assert math.hypot(graph.pose(60).x, graph.pose(60).y) > 5.0
    graph.add(BetweenFactor(0, 60, Pose2(), CLOSURE * 0.01))
    graph.update()
    end = graph.pose(60)
    assert math.hypot(end.x, end.y) < 0.05
    assert abs(end.theta) < 0.02
    steps = np.diff(graph.poses()[:, :2], axis=0)
    np.testing.assert_allclose(np.hypot(*steps.T), 1.0, atol=0.02)


def test_restarting_at_the_solution_keeps_it_and_what_comes_after_still_works() -> None:
    recorded = loops(np.array([0.0, 0.01, 0.01, 0.0]), 2)
    graph = PoseGraph(BackendConfig(), PRIOR)
    drive(graph, recorded, {k: k - 80 for k in range(80, 160, 20)})
    graph.settle()
    before, covariance = graph.poses(), graph.covariance(160)
    graph.restart(graph.calibration_values(), before)
    assert graph.pending
    graph.update()
    assert not graph.pending
    np.testing.assert_allclose(between_all(before, graph.poses()), 0, atol=0.015)
    np.testing.assert_allclose(graph.covariance(160), covariance, rtol=0.05, atol=1e-6)
    removed = next(n for n, f in graph.factors().items() if isinstance(f, BetweenFactor))
    graph.remove(removed)
    summary = graph.update()
    assert (summary.added, summary.removed, summary.factors) == (0, 1, 163)


def test_restarting_from_far_away_finds_the_same_solution() -> None:
    recorded = loops(np.zeros(4), 2)
    graph = PoseGraph(BackendConfig(), PRIOR)
    drive(graph, recorded, {k: k - 80 for k in range(80, 161, 10)})
    graph.settle()
    before = graph.poses()
    off = before + np.random.default_rng(1).normal(0, [0.5, 0.5, 0.1], before.shape)
    graph.restart(np.array([0.0, 0.0, 0.01, 0.0]), off)
    graph.update()
    np.testing.assert_allclose(graph.poses()[:, :2], before[:, :2], atol=0.02)


def test_keyframes_that_come_after_a_restart_was_asked_for_follow_on_from_it() -> None:
    graph = chain(ARC)
    turned = np.array([(Pose2(0.0, 0.0, 0.0) @ T).array() for T in (graph.pose(k) for k in range(11))])
    step = Pose2(0.5, 0.0, 0.0)
    graph.restart(np.zeros(4), turned)
    graph.add_keyframe(graph.pose(10) @ step)
    graph.add(BetweenFactor(10, 11, step, STEP))
    summary = graph.update()
    assert (summary.added, summary.factors) == (1, 11)
    assert graph.pose(11).distance(graph.pose(10) @ step) < 1e-6


def test_places_that_are_one_pull_the_drive_together_and_leave_its_size() -> None:
    """Wheels that turn by themselves by 0.02 rad/m; the rounds are tied by places half a metre off their keyframes."""
    recorded = loops(np.array([0.0, 0.0, 0.02, 0.0]), 3)
    graph = PoseGraph(BackendConfig(), PRIOR)
    drive(graph, recorded, {})
    off = Pose2(0.4, -0.3, 0.0)
    for k in range(80, 241, 4):
        a, b = k - 80, k
        in_b = recorded.truth[b].between(recorded.truth[a] @ off)
        graph.add(NearFactor(a, b, off.array()[:2], in_b.array()[:2], 0.1))
    assert graph.pending
    graph.settle()
    assert errors_m(graph, recorded.truth).max() < 0.5
    assert abs(graph.calibration().values[0]) < 1e-3
    assert abs(graph.calibration().values[2] - 0.02) < 0.002


def test_the_covariance_of_a_place_is_the_spread_of_poses_drawn_from_the_relative_pose() -> None:
    graph = chain(ARC)
    place = np.array([0.1, 4.0])
    T, relative = graph.pose(2).between(graph.pose(9)), graph.relative_covariance(2, 9)
    drawn = np.random.default_rng(0).multivariate_normal(T.array(), relative, 20_000)
    places = compose_all(drawn, np.array([*place, 0.0]))[:, :2]
    found = graph.place_covariance(2, 9, place)
    np.testing.assert_allclose(found, np.cov(places, rowvar=False), atol=0.04 * np.trace(found))


def test_a_long_drive_on_wheels_alone_stays_solvable() -> None:
    """Half-metre steps with one loose calibration between all of them: too ill-conditioned for Cholesky."""
    graph = PoseGraph(BackendConfig(), PRIOR)
    recorded = loops(np.array([0.0, 0.0, 0.025, 0.0]), 10, noise=0.2)
    drive(graph, recorded, {})
    assert graph.keyframes == 801
    assert np.isfinite(graph.covariance(800)).all()
    graph.add(BetweenFactor(720, 800, recorded.truth[720].between(recorded.truth[800]), CLOSURE))
    graph.update()
    assert np.isfinite(graph.poses()).all()


def test_the_same_drive_gives_the_same_estimate_to_the_bit() -> None:
    recorded = loops(np.array([0.0, 0.0, 0.02, 0.0]), 2)
    graphs = [PoseGraph(BackendConfig(), PRIOR) for _ in range(2)]
    for graph in graphs:
        drive(graph, recorded, {k: k - 80 for k in range(80, 161, 20)})
        graph.settle()
    np.testing.assert_array_equal(graphs[0].poses(), graphs[1].poses())
    np.testing.assert_array_equal(graphs[0].calibration().values, graphs[1].calibration().values)
    np.testing.assert_array_equal(graphs[0].covariance(160), graphs[1].covariance(160))


def test_a_given_calibration_is_the_prior() -> None:
    prior = WheelCalibration(np.array([0.01, 0.0, 0.02, 0.0]), np.array([1e-3, 1e-3, 1e-3, 1e-5]))
    graph = PoseGraph(BackendConfig(), prior)
    graph.add_keyframe(Pose2())
    graph.update()
    found = graph.calibration()
    np.testing.assert_allclose(found.values, prior.values, atol=1e-12)
    np.testing.assert_allclose(found.sigmas, prior.sigmas, rtol=1e-6)


def test_the_summary_counts_what_went_in_and_out() -> None:
    graph = chain(ARC)
    number = graph.add(BetweenFactor(0, 10, graph.pose(0).between(graph.pose(10)), CLOSURE))
    summaries: list[Any] = [graph.update()]
    graph.remove(number)
    summaries.append(graph.update())
    assert [(s.added, s.removed, s.factors) for s in summaries] == [(1, 0, 11), (0, 1, 10)]
    assert wrap(graph.pose(0).theta) == pytest.approx(0, abs=1e-9)
