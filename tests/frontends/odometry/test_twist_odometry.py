"""Twists are integrated exactly along arcs, and only where the pose is never filled."""

import math
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, Odometry
from wayfi.frontends.odometry.twist_odometry import ENDS, LEADS, TwistOdometry

STEP_S = 0.05


def stream(poses: list[Pose2], twist: tuple[float, float, float]) -> list[Odometry]:
    return [Odometry(round(k * STEP_S * SECOND_NS), pose, twist=twist) for k, pose in enumerate(poses)]


@given(st.floats(-1.0, 1.0), st.floats(-0.5, 0.5), st.floats(-3.0, 3.0), st.sampled_from([0.0, math.nan]))
def test_an_arc_ends_where_it_has_to(v: float, side: float, omega: float, heading: float) -> None:
    twist, odometry = (v, side, omega), TwistOdometry()
    followed = [odometry.follow(m) for m in stream([Pose2(1.0, 2.0, heading)] * 101, twist)]
    if math.hypot(v, side) < 0.051:
        return
    step = Pose2(v * STEP_S, side * STEP_S, 0.0)
    half = Pose2(0.0, 0.0, 0.5 * omega * STEP_S)
    start = Pose2(1.0, 2.0, 0.0) if heading == 0.0 else Pose2()
    *_, end = accumulate([half @ step @ half] * 100, Pose2.__matmul__, initial=start)
    assert followed[-1][0].distance(end) < 1e-6
    assert [told for _, told in followed if told] == [LEADS]


def test_a_pose_that_is_filled_is_left_alone() -> None:
    odometry = TwistOdometry()
    poses = [Pose2(0.01 * k, 0.0, 0.001 * k) for k in range(100)]
    assert [odometry.follow(m) for m in stream(poses, (5.0, 0.0, 5.0))] == [(pose, "") for pose in poses]


@pytest.mark.parametrize(("alike", "told"), [(2, []), (5, [LEADS])])
def test_a_heading_that_is_the_same_in_two_rare_messages_is_filled(alike: int, told: list[str]) -> None:
    odometry, headings = TwistOdometry(), [0.5] * alike + [0.51, 0.52]
    poses = [Pose2(1.0 * k, 0.0, heading) for k, heading in enumerate(headings)]
    messages = [Odometry(3 * k * SECOND_NS, pose, twist=(0.3, 0.0, 0.01)) for k, pose in enumerate(poses)]
    assert [text for _, text in map(odometry.follow, messages) if text == LEADS] == told


@pytest.mark.parametrize("twist", [(0.0, 0.0, 0.0), (0.04, 0.0, 0.0), (0.0, 0.0, 0.09)])
def test_a_robot_that_stands_is_left_standing(twist: tuple[float, float, float]) -> None:
    odometry = TwistOdometry()
    assert {odometry.follow(m) for m in stream([Pose2()] * 1000, twist)} == {(Pose2(), "")}


def test_a_heading_that_is_filled_is_kept_and_the_position_integrated_along_it() -> None:
    odometry = TwistOdometry()
    poses = [Pose2(0.0, 0.0, 0.02 * k) for k in range(80)]
    *_, (end, _) = [odometry.follow(m) for m in stream(poses, (1.0, 0.0, 0.0))]
    assert end.theta == poses[-1].theta
    radius = STEP_S / 0.02
    assert end.x == pytest.approx(radius * math.sin(end.theta), abs=0.01)


def test_the_pose_is_used_again_once_it_changes() -> None:
    odometry = TwistOdometry()
    poses = [Pose2()] * 20 + [Pose2(0.1 * k, 0.0, 0.1 * k) for k in range(1, 5)]
    followed = [odometry.follow(m) for m in stream(poses, (1.0, 0.0, 0.5))]
    assert [told for _, told in followed if told] == [LEADS, ENDS]
    assert followed[-1][0] == poses[-1]


def test_twists_that_are_not_finite_are_passed_over() -> None:
    odometry = TwistOdometry()
    for m in stream([Pose2()] * 50, (math.inf, math.nan, 1e308)):
        pose, _ = odometry.follow(m)
        assert pose == Pose2()
