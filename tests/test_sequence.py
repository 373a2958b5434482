"""The rigid motion between two sequences of places, and what their shape leaves open."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.sequence import SequenceFit, fit_sequence, rigid_motion

POSES = st.builds(Pose2, st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3))

STRAIGHT = np.stack([np.arange(40) * 0.5, np.zeros(40)], axis=1)
BENT = np.concatenate([STRAIGHT[:20], np.stack([np.full(20, 9.5), 0.5 * np.arange(1, 21)], axis=1)])


def alike(points_a: Floats, points_b: Floats, reach_m: float = 3.0) -> Floats:
    """(n, m) similarity that fades with the distance of the places, as if both were in one frame."""
    d2 = ((points_b[:, None] - points_a[None]) ** 2).sum(axis=2)
    return np.asarray(np.exp(-0.5 * d2 / reach_m**2))


def fitted(places: Floats, T_a_b: Pose2, noise_m: float = 0.0, seed: int = 0) -> SequenceFit:
    rng = np.random.default_rng(seed)
    in_b = T_a_b.inverse().transform(places) + noise_m * rng.standard_normal(places.shape)
    return fit_sequence(alike(places, places), places, in_b, neighbours=1, independent_m=4.0)


@settings(deadline=None)
@given(POSES, st.integers(0, 2**31), st.integers(2, 30))
def test_a_rigid_motion_is_recovered(T: Pose2, seed: int, n: int) -> None:
    source = np.random.default_rng(seed).uniform(-10, 10, (n, 2))
    found = rigid_motion(source, T.transform(source))
    assert found.distance(T) < 1e-6
    assert abs(wrap(found.theta - T.theta)) < 1e-6


def test_no_motion_fits_noisy_points_better_than_the_one_found() -> None:
    rng = np.random.default_rng(0)
    source = rng.uniform(-5, 5, (30, 2))
    target = Pose2(1.0, 2.0, 0.5).transform(source) + rng.normal(0, 0.3, source.shape)
    T = rigid_motion(source, target)

    def cost(dx: float = 0.0, dy: float = 0.0, dtheta: float = 0.0) -> float:
        moved = Pose2(T.x + dx, T.y + dy, T.theta + dtheta).transform(source)
        return float(((moved - target) ** 2).sum())

    for e in (-1e-3, 1e-3):
        assert cost() < min(cost(dx=e), cost(dy=e), cost(dtheta=e))


@settings(deadline=None)
@given(POSES)
def test_the_pose_between_two_sequences_of_one_place_is_found(T_a_b: Pose2) -> None:
    fit = fitted(BENT, T_a_b)
    assert fit.T_a_b.distance(T_a_b) < 1e-6
    assert abs(wrap(fit.T_a_b.theta - T_a_b.theta)) < 1e-6
    assert fit.residual_m < 1e-6


def test_a_sequence_driven_the_other_way_round_is_found_as_well() -> None:
    T_a_b = Pose2(9.0, 1.0, math.pi - 0.1)
    backwards = BENT[::-1]
    fit = fit_sequence(alike(BENT, backwards), BENT, T_a_b.inverse().transform(backwards), 1, 4.0)
    assert fit.T_a_b.distance(T_a_b) < 1e-6


def test_the_mean_of_the_most_similar_is_weighted_by_their_similarity() -> None:
    similarity = np.array([[0.9, 0.3, 0.0], [0.0, 0.5, 0.5]])
    places_a = np.array([[0.0, 0.0], [4.0, 0.0], [8.0, 0.0]])
    fit = fit_sequence(similarity, places_a, np.array([[0.0, 0.0], [5.0, 0.0]]), 2, 4.0)
    np.testing.assert_allclose(fit.points_a, [[1.0, 0.0], [6.0, 0.0]], atol=1e-6)


@pytest.mark.parametrize("heading", [0.0, 1.0, -2.5])
def test_the_covariance_is_symmetric_positive_and_falls_with_the_length_of_the_window(heading: float) -> None:
    T = Pose2(1.0, 2.0, heading)
    long, short = fitted(BENT, T, 1.0), fitted(BENT[:10], T, 1.0)
    for fit in (long, short):
        np.testing.assert_allclose(fit.covariance, fit.covariance.T, atol=1e-9)
        assert np.linalg.eigvalsh(fit.covariance)[0] > 0
    assert long.covariance[2, 2] < 0.1 * short.covariance[2, 2]


def test_a_straight_window_ahead_leaves_the_side_more_open_than_the_way() -> None:
    """The origin of b is 20 m behind its window: what the heading leaves open swings it to the side."""
    ahead = STRAIGHT + np.array([20.0, 0.0])
    covariance = fitted(ahead, Pose2(), 1.0).covariance
    assert covariance[1, 1] > 10 * covariance[0, 0]
    turned = fitted(Pose2(0.0, 0.0, math.pi / 2).transform(ahead), Pose2(0.0, 0.0, math.pi / 2), 1.0).covariance
    assert turned[0, 0] > 10 * turned[1, 1]


def test_a_short_window_hardly_knows_its_heading() -> None:
    assert math.sqrt(fitted(STRAIGHT[:3], Pose2(), 0.5).covariance[2, 2]) > 0.5


def test_errors_of_fits_are_as_large_as_their_covariance_says() -> None:
    """With errors that are alike over 4 m, as shadowing is."""
    rng, T = np.random.default_rng(4), Pose2(2.0, -1.0, 0.4)
    nees = []
    for _ in range(200):
        errors = np.repeat(rng.normal(0, 1.0, (5, 2)), 8, axis=0)
        fit = fit_sequence(alike(BENT, BENT), BENT + errors, T.inverse().transform(BENT), 1, 4.0)
        e = np.array([fit.T_a_b.x - T.x, fit.T_a_b.y - T.y, wrap(fit.T_a_b.theta - T.theta)])
        nees.append(float(e @ np.linalg.solve(fit.covariance, e)) / 3)
    assert 0.5 < np.mean(nees) < 3.0
