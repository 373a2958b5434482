"""The laws of SE(2), and the batch functions against the single ones."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.pose2 import Floats, Pose2, adjoint, between_all, compose_all, wrap, wrap_all

METRES = st.floats(-1e3, 1e3)
ANGLES = st.floats(-10.0, 10.0)
POSES = st.builds(Pose2, METRES, METRES, ANGLES)
SMALL = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
TOLERANCE = 1e-9

law = settings(deadline=None)


def assert_same(a: Pose2, b: Pose2, atol: float = TOLERANCE) -> None:
    np.testing.assert_allclose([a.x, a.y, wrap(a.theta - b.theta)], [b.x, b.y, 0.0], rtol=0, atol=atol)


@law
@given(POSES, POSES, POSES)
def test_composition_is_associative(a: Pose2, b: Pose2, c: Pose2) -> None:
    assert_same((a @ b) @ c, a @ (b @ c))


@law
@given(POSES)
def test_a_pose_and_its_inverse_cancel(a: Pose2) -> None:
    assert_same(a @ a.inverse(), Pose2())
    assert_same(a.inverse() @ a, Pose2())
    assert_same(a @ Pose2(), a)


@law
@given(POSES, POSES)
def test_the_inverse_of_a_product_is_the_product_of_the_inverses_turned_round(a: Pose2, b: Pose2) -> None:
    assert_same((a @ b).inverse(), b.inverse() @ a.inverse())


@law
@given(POSES, POSES)
def test_between_leads_from_one_to_the_other(a: Pose2, b: Pose2) -> None:
    assert_same(a @ a.between(b), b)


@law
@given(POSES, POSES, METRES, METRES)
def test_a_product_moves_points_as_its_parts_do(a: Pose2, b: Pose2, x: float, y: float) -> None:
    point = np.array([[x, y]])
    np.testing.assert_allclose((a @ b).transform(point), a.transform(b.transform(point)), rtol=0, atol=TOLERANCE)


@law
@given(POSES, POSES)
def test_distance_is_the_length_of_between(a: Pose2, b: Pose2) -> None:
    T_a_b = a.between(b)
    assert math.isclose(a.distance(b), math.hypot(T_a_b.x, T_a_b.y), rel_tol=1e-12, abs_tol=TOLERANCE)


@law
@given(st.floats(-1e6, 1e6))
def test_wrapped_angles_lie_in_the_half_open_circle_and_point_the_same_way(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi <= wrapped < math.pi
    assert abs(math.remainder(wrapped - angle, 2 * math.pi)) < 1e-9
    assert wrap_all(np.array([angle]))[0] == wrapped
    assert wrap(wrapped) == wrapped


def test_an_angle_just_below_minus_pi_does_not_round_up_to_pi() -> None:
    below = math.nextafter(-math.pi, -math.inf)
    assert -math.pi <= wrap(below) < math.pi
    assert -math.pi <= wrap_all(np.array([below]))[0] < math.pi
    assert math.isnan(wrap(math.nan))
    assert np.isnan(wrap_all(np.array([math.nan]))[0])


@law
@given(POSES, POSES)
def test_interpolation_meets_both_ends_and_turns_the_short_way(a: Pose2, b: Pose2) -> None:
    assert_same(a.interpolate(b, 0.0), a)
    assert_same(a.interpolate(b, 1.0), b)
    half = a.interpolate(b, 0.5)
    assert abs(wrap(half.theta - a.theta)) <= math.pi / 2 + 1e-9


@law
@given(POSES, SMALL)
def test_the_adjoint_carries_a_small_motion_from_the_child_to_the_parent(T: Pose2, motion: Floats) -> None:
    small = 1e-7 * np.array(motion)
    carried = adjoint(T) @ small
    in_child, in_parent = T @ Pose2.of(small), Pose2.of(carried) @ T
    assert_same(in_child, in_parent, atol=1e-9)


@law
@given(POSES, POSES)
def test_the_adjoint_of_a_product_is_the_product_of_the_adjoints(a: Pose2, b: Pose2) -> None:
    np.testing.assert_allclose(adjoint(a @ b), adjoint(a) @ adjoint(b), rtol=0, atol=1e-8)


@law
@given(st.lists(st.tuples(POSES, POSES), min_size=1, max_size=5))
def test_batch_functions_agree_with_single_ones(pairs: list[tuple[Pose2, Pose2]]) -> None:
    a, b = (np.array([pair[i].array() for pair in pairs]) for i in (0, 1))
    for composed, between, (one, other) in zip(compose_all(a, b), between_all(a, b), pairs, strict=True):
        assert_same(Pose2.of(composed), one @ other)
        assert_same(Pose2.of(between), one.between(other))
        assert -math.pi <= composed[2] < math.pi


@law
@given(POSES, st.lists(POSES, min_size=1, max_size=4))
def test_batch_functions_take_one_pose_with_many(one: Pose2, many: list[Pose2]) -> None:
    array = np.array([pose.array() for pose in many])
    np.testing.assert_array_equal(
        compose_all(one.array(), array), compose_all(np.tile(one.array(), (len(many), 1)), array)
    )
    np.testing.assert_array_equal(between_all(array, one.array())[0], between_all(array[0], one.array())[0])


def test_a_pose_with_a_number_that_is_none_is_not_finite() -> None:
    assert Pose2(1.0, 2.0, 3.0).is_finite()
    for bad in (math.nan, math.inf, -math.inf):
        assert not Pose2(bad, 0.0, 0.0).is_finite()
        assert not Pose2(0.0, bad, 0.0).is_finite()
        assert not Pose2(0.0, 0.0, bad).is_finite()
