"""The pose graph against analytic chains and sampled drives: estimate, covariances, adding and removing."""

import math
from typing import Any

import numpy as np
import pytest
from graphs import ARC, CLOSURE, PRIOR, STEP, chain, drive, errors_m, loops

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import BetweenFactor, NearFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.pose2 import Floats, Pose2, adjoint, compose_all, wrap


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
    assert abs(graph.calibration().values[0]) < 0.1 * PRIOR.sigmas[0]
    assert abs(graph.calibration().values[2] - 0.02) < 0.002


def test_the_covariance_of_a_place_is_the_spread_of_poses_drawn_from_the_relative_pose() -> None:
    graph = chain(ARC)
    place = np.array([0.1, 4.0])
    T, relative = graph.pose(2).between(graph.pose(9)), graph.relative_covariance(2, 9)
    drawn = np.random.default_rng(0).multivariate_normal(T.array(), relative, 20_000)
    places = compose_all(drawn, np.array([*place, 0.0]))[:, :2]
    found = graph.place_covariance(2, 9, place)
    np.testing.assert_allclose(found, np.cov(places, rowvar=False), atol=0.04 * np.trace(found))


def test_the_summary_counts_what_went_in_and_out() -> None:
    graph = chain(ARC)
    number = graph.add(BetweenFactor(0, 10, graph.pose(0).between(graph.pose(10)), CLOSURE))
    summaries: list[Any] = [graph.update()]
    graph.remove(number)
    summaries.append(graph.update())
    assert [(s.added, s.removed, s.factors) for s in summaries] == [(1, 0, 11), (0, 1, 10)]
    assert wrap(graph.pose(0).theta) == pytest.approx(0, abs=1e-9)
