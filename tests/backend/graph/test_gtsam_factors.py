"""The factors as gtsam sees them: Jacobians against differences, covariances in the axes they claim."""

import math

import gtsam
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from wayfi.backend.graph.factors import NearFactor, WheelFactor
from wayfi.backend.graph.gtsam_factors import (
    between_factor,
    calibration_key,
    near_factor,
    pose_key,
    wheel_factor,
)
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2, covariance_in_b, pose_of_common_place, wrap

STRETCH = 3
CALIBRATION = calibration_key(STRETCH)
COVARIANCE = np.array([[0.04, 0.01, 0.002], [0.01, 0.09, -0.003], [0.002, -0.003, 0.01]])
POSES = st.builds(Pose2, st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3))
MOTIONS = st.builds(WheelMotion, POSES, st.floats(0, 3), st.floats(0, 10))
CALIBRATIONS = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-0.01, 0.01)).map(
    np.array
)


def values(a: Pose2, b: Pose2, calibration: Floats) -> gtsam.Values:
    at = gtsam.Values()
    at.insert(pose_key(0), gtsam.Pose2(a.x, a.y, a.theta))
    at.insert(pose_key(1), gtsam.Pose2(b.x, b.y, b.theta))
    at.insert(CALIBRATION, calibration)
    return at


def whitened(factor: gtsam.NonlinearFactor, at: gtsam.Values) -> tuple[Floats, Floats]:
    """The Jacobian (3, 10) and the right-hand side (3,) of the linearised factor, keys in the factor's order."""
    A, b = factor.linearize(at).jacobian()
    return np.asarray(A), np.asarray(b)


def assert_jacobians_match(factor: gtsam.NonlinearFactor, at: gtsam.Values) -> None:
    """The factor's Jacobian at `at` against differences."""
    A, _ = whitened(factor, at)
    h = 1e-6
    for i in range(10):
        key, size, axis = [(pose_key(0), 3, i), (pose_key(1), 3, i - 3), (CALIBRATION, 4, i - 6)][min(i // 3, 2)]
        sides = []
        for sign in (1, -1):
            delta = gtsam.VectorValues()
            delta.insert(key, sign * h * np.eye(size)[axis])
            for other, dimension in ((pose_key(0), 3), (pose_key(1), 3), (CALIBRATION, 4)):
                if other != key:
                    delta.insert(other, np.zeros(dimension))
            sides.append(-whitened(factor, at.retract(delta))[1])
        np.testing.assert_allclose(A[:, i], (sides[0] - sides[1]) / (2 * h), atol=1e-6)


PLACES = st.tuples(st.floats(-2, 2), st.floats(-2, 2)).map(np.array)


@settings(deadline=None, max_examples=50)
@given(POSES, POSES, PLACES, PLACES, CALIBRATIONS)
def test_the_near_factors_jacobians_are_those_of_its_error(
    a: Pose2, b: Pose2, place_a: Floats, place_b: Floats, calibration: Floats
) -> None:
    assert_jacobians_match(near_factor(NearFactor(0, 1, place_a, place_b, 0.7), STRETCH), values(a, b, calibration))


@settings(deadline=None, max_examples=50)
@given(POSES, POSES, PLACES, PLACES, st.floats(-0.5, 1.0))
def test_the_near_factor_says_nothing_of_the_scale_and_is_content_where_the_places_meet(
    a: Pose2, b: Pose2, place_a: Floats, place_b: Floats, scale: float
) -> None:
    factor = near_factor(NearFactor(0, 1, place_a, place_b, 0.5), STRETCH)
    as_driven, scaled = (
        values(a, b, np.zeros(4)),
        values(*(Pose2((1 + scale) * T.x, (1 + scale) * T.y, T.theta) for T in (a, b)), np.array([scale, 0, 0, 0])),
    )
    assert math.isclose(factor.error(scaled), factor.error(as_driven), rel_tol=1e-6, abs_tol=1e-9)
    together = pose_of_common_place(place_a, place_b, 0.3)
    assert factor.error(values(a, a @ together, np.zeros(4))) < 1e-12
    apart = a.transform(place_a[None])[0] - b.transform(place_b[None])[0]
    assert math.isclose(factor.error(as_driven), 0.5 * float(apart @ apart) / 0.5**2, rel_tol=1e-6, abs_tol=1e-9)


@settings(deadline=None, max_examples=50)
@given(POSES, POSES, MOTIONS, CALIBRATIONS)
def test_the_wheel_factors_jacobians_are_those_of_its_error(
    a: Pose2, b: Pose2, motion: WheelMotion, calibration: Floats
) -> None:
    error = a.between(b).theta - motion.corrected(calibration).theta
    if abs(abs(wrap(error)) - math.pi) < 1e-3:
        return  # the error itself leaps there
    for alone in (False, True):
        factor = wheel_factor(WheelFactor(0, 1, motion, np.eye(3), alone), STRETCH)
        assert_jacobians_match(factor, values(a, b, calibration))


@settings(deadline=None, max_examples=50)
@given(POSES, MOTIONS, CALIBRATIONS)
def test_the_wheel_factor_is_content_where_the_calibrated_wheels_are_right(
    a: Pose2, motion: WheelMotion, calibration: Floats
) -> None:
    at = values(a, a @ motion.corrected(calibration), calibration)
    assert wheel_factor(WheelFactor(0, 1, motion, COVARIANCE), STRETCH).error(at) < 1e-15


@settings(deadline=None)
@given(st.floats(-3, 3))
def test_a_covariance_turned_into_the_axes_of_b_keeps_its_size_and_comes_back(theta: float) -> None:
    turned = covariance_in_b(COVARIANCE, theta)
    np.testing.assert_allclose(np.linalg.eigvalsh(turned), np.linalg.eigvalsh(COVARIANCE), atol=1e-12)
    np.testing.assert_allclose(covariance_in_b(turned, -theta), COVARIANCE, atol=1e-12)
    assert math.isclose(turned[2, 2], COVARIANCE[2, 2])


def test_what_is_open_along_as_x_axis_is_open_along_bs_y_axis_when_b_has_turned_left() -> None:
    turned = covariance_in_b(np.diag([100.0, 1.0, 0.1]), math.pi / 2)
    np.testing.assert_allclose(turned, np.diag([1.0, 100.0, 0.1]), atol=1e-12)


@settings(deadline=None, max_examples=50)
@given(POSES, POSES, st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)))
def test_both_factors_weigh_an_error_in_the_axes_of_a(a: Pose2, T_a_b: Pose2, direction: Floats) -> None:
    """Half the squared Mahalanobis distance of a small error in (x, y, theta) of a, for either factor."""
    e = 1e-4 * np.array(direction)
    b = a @ Pose2(T_a_b.x + e[0], T_a_b.y + e[1], T_a_b.theta + e[2])
    at = values(a, b, np.zeros(4))
    expected = 0.5 * e @ np.linalg.solve(COVARIANCE, e)
    wheels = wheel_factor(WheelFactor(0, 1, WheelMotion(T_a_b, 1.0, 1.0), COVARIANCE), STRETCH)
    between = between_factor(0, 1, T_a_b, COVARIANCE)
    assert math.isclose(wheels.error(at), expected, rel_tol=1e-3, abs_tol=1e-14)
    assert math.isclose(between.error(at), expected, rel_tol=1e-3, abs_tol=1e-14)


def test_errors_drawn_from_the_covariance_are_as_large_as_the_factor_expects() -> None:
    rng = np.random.default_rng(3)
    T_a_b, a = Pose2(2.0, -1.0, 2.2), Pose2(3.0, 4.0, -1.0)
    factor = between_factor(0, 1, T_a_b, COVARIANCE * 1e-4)
    draws = rng.multivariate_normal(np.zeros(3), COVARIANCE * 1e-4, 2000)
    errors = [
        2 * factor.error(values(a, a @ Pose2(T_a_b.x + x, T_a_b.y + y, T_a_b.theta + t), np.zeros(4)))
        for x, y, t in draws
    ]
    low, high = chi2.ppf([0.0005, 0.9995], 3 * len(errors)) / len(errors)
    assert low < np.mean(errors) < high


def test_a_factor_in_python_is_handed_the_values_that_python_holds_and_no_copy_of_them() -> None:
    """What keeps the cost of an update from growing with the drive; gtsam copies what Python does not hold."""
    isam, seen = gtsam.ISAM2(), []

    def error(_: gtsam.CustomFactor, at: gtsam.Values, jacobians: list[Floats] | None) -> Floats:
        seen.append(at)
        if jacobians is not None:
            jacobians[0] = np.eye(3)
        return np.zeros(3)

    held = isam.getLinearizationPoint()
    graph, new = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.add(gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(3), [pose_key(0)], error))
    new.insert(pose_key(0), gtsam.Pose2())
    isam.update(graph, new)
    assert seen
    assert all(at is held for at in seen)
