"""The path that the wheels drive: increments, moments between messages, leaps and restarts."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.pose2 import Pose2, wrap
from wayfi.frontends.keyframes import keyframe_due
from wayfi.frontends.odometry.driven_path import DrivenPath, LedStep
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.wheel_noise import wheel_covariance

CONFIG = OdometryConfig()
S = 1_000_000_000
STEPS = st.lists(
    st.builds(Pose2, st.floats(-0.3, 0.3), st.floats(-0.1, 0.1), st.floats(-0.5, 0.5)), min_size=1, max_size=20
)


def driven(steps: list[Pose2], start: Pose2 | None = None, path_s: float = 1000.0) -> DrivenPath:
    """One message a second."""
    path, T = DrivenPath(replace(CONFIG, path_s=path_s)), start or Pose2()
    path.advance(0, T)
    for k, step in enumerate(steps):
        T = T @ step
        assert path.advance((k + 1) * S, T)
    return path


@settings(deadline=None)
@given(STEPS, st.builds(Pose2, st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3)))
def test_the_path_is_the_odometry_and_its_length_the_sum_of_the_steps(steps: list[Pose2], start: Pose2) -> None:
    path, T = driven(steps, start), start
    for step in steps:
        T = T @ step
    latest = path.latest
    assert latest is not None
    assert latest.T_path_base.distance(T) < 1e-9
    assert abs(wrap(latest.T_path_base.theta - T.theta)) < 1e-9
    assert latest.path_m == pytest.approx(sum(math.hypot(step.x, step.y) for step in steps), abs=1e-9)


@settings(deadline=None)
@given(STEPS, st.floats(0, 1), st.floats(0, 1))
def test_motions_join_at_any_moment(steps: list[Pose2], early: float, late: float) -> None:
    path, end_ns = driven(steps), len(steps) * S
    points = [path.at(int(share * end_ns)) for share in (0.0, min(early, late), max(early, late))]
    first, a, b = (point for point in points if point is not None)
    whole, parts = first.motion_to(b), [first.motion_to(a), a.motion_to(b)]
    assert whole.path_m == pytest.approx(parts[0].path_m + parts[1].path_m, abs=1e-9)
    assert whole.seconds == pytest.approx(parts[0].seconds + parts[1].seconds, abs=1e-9)
    assert whole.pose.distance(parts[0].pose @ parts[1].pose) < 1e-9
    assert min(part.path_m for part in parts) >= 0


def test_between_two_messages_the_path_is_straight() -> None:
    point = driven([Pose2(0.4, 0.2, 1.0)]).at(S // 4)
    assert point is not None
    np.testing.assert_allclose(point.T_path_base.array(), [0.1, 0.05, 0.25], atol=1e-12)
    assert point.path_m == pytest.approx(math.hypot(0.4, 0.2) / 4)


def test_the_heading_is_interpolated_the_short_way_round() -> None:
    point = driven([Pose2(0.0, 0.0, 0.2)], Pose2(0.0, 0.0, math.pi - 0.1)).at(S // 2)
    assert point is not None
    assert abs(wrap(point.T_path_base.theta - math.pi)) < 1e-9


def test_a_moment_outside_of_what_is_kept_has_no_place() -> None:
    assert DrivenPath(CONFIG).at(0) is None
    assert DrivenPath(CONFIG).latest is None
    path = driven([Pose2(0.1, 0.0, 0.0)] * 20, path_s=5.0)
    assert path.at(21 * S) is None
    assert path.at(-1) is None
    assert path.at(10 * S) is None
    assert path.at(16 * S) is not None
    latest = path.latest
    assert latest is not None
    assert path.at(20 * S) == latest


def test_a_leap_counts_as_no_motion_and_the_path_goes_on_from_there() -> None:
    path = driven([Pose2(0.1, 0.0, 0.0)])
    assert not path.advance(2 * S, Pose2(100.0, 50.0, 2.0))
    assert path.advance(3 * S, Pose2(100.0, 50.0, 2.0) @ Pose2(0.2, 0.0, 0.1))
    latest = path.latest
    assert latest is not None
    np.testing.assert_allclose(latest.T_path_base.array(), [0.3, 0.0, 0.1], atol=1e-9)
    assert latest.path_m == pytest.approx(0.3)


def test_a_gap_in_the_odometry_may_be_long_if_its_speed_is_plausible() -> None:
    path = driven([])
    assert path.advance(20 * S, Pose2(30.0, 0.0, 0.0))
    assert not path.advance(21 * S, Pose2(30.0 + CONFIG.max_speed_m_s + 0.1, 0.0, 0.0))


def test_another_source_of_odometry_joins_without_motion() -> None:
    path = driven([Pose2(0.3, 0.0, 0.5)])
    before = path.latest
    path.restart()
    assert path.advance(2 * S, Pose2(-7.0, 3.0, 1.0))
    after = path.latest
    assert before is not None
    assert after is not None
    assert after.T_path_base == before.T_path_base @ Pose2()
    assert after.path_m == before.path_m


def test_odometry_that_begins_anew_while_nobody_looks_says_nothing_of_the_way() -> None:
    path = DrivenPath(OdometryConfig())
    path.advance(0, Pose2(8.0, 3.0, 0.5))
    before = path.latest
    path.go_on()
    assert not path.advance(60 * 10**9, Pose2(0.01, 0.0, 0.0))
    after = path.latest
    assert before is not None
    assert after is not None
    motion = before.motion_to(after)
    assert motion.pose.distance(Pose2()) < 1e-12
    assert (motion.path_m, motion.discontinuities) == (0.0, 1)
    assert keyframe_due(motion, OdometryConfig())
    assert np.sqrt(wheel_covariance(motion, OdometryConfig())[0, 0]) >= 1.0


def test_odometry_that_goes_on_while_nobody_looks_is_believed() -> None:
    path = DrivenPath(OdometryConfig())
    path.advance(0, Pose2(8.0, 3.0, 0.5))
    path.go_on()
    assert path.advance(60 * 10**9, Pose2(12.0, 3.0, 0.0))
    latest = path.latest
    assert latest is not None
    assert latest.path_m == pytest.approx(4.0)
    assert latest.discontinuities == 0


def test_a_leap_says_how_far_and_hides_a_motion_unless_it_leads_to_the_origin_at_once() -> None:
    away, restarted = driven([]), DrivenPath(OdometryConfig())
    assert not away.advance(3 * S, Pose2(20.0, 0.0, 0.5))
    assert away.leapt_m == pytest.approx(20.0)
    restarted.advance(0, Pose2(8.0, 6.0, 0.5))
    assert not restarted.advance(S // 10, Pose2())
    assert restarted.leapt_m == pytest.approx(10.0)
    assert away.latest is not None
    assert restarted.latest is not None
    assert restarted.latest.discontinuities == 0
    assert restarted.advance(S // 5, Pose2(0.01, 0.0, 0.0))
    assert restarted.leapt_m == 0.0


@pytest.mark.parametrize(("seconds", "lands", "unknown"), [(0.1, 0.0, 0), (2.0, 0.0, 1), (0.1, 30.0, 1)])
def test_what_a_restart_hides_depends_on_its_time_and_place(seconds: float, lands: float, unknown: int) -> None:
    path = DrivenPath(OdometryConfig())
    path.advance(0, Pose2(20.0, 6.0, 0.5))
    assert not path.advance(round(seconds * S), Pose2(lands, 0.0, 0.0))
    assert path.latest is not None
    assert path.latest.discontinuities == unknown


def test_lengths_of_many_moments_are_those_of_each() -> None:
    path = DrivenPath(CONFIG)
    for k in range(50):
        path.advance(1_000 + 100_000_007 * k, Pose2(0.01 * k * k, 0.0, 0.0))
    stamps_ns = np.concatenate([np.arange(0, 5_200_000_000, 33_333_333), [1_000, 1_000 + 49 * 100_000_007]])
    points = [path.at(int(stamp_ns)) for stamp_ns in stamps_ns]
    expected = [point.path_m if point else math.nan for point in points]
    assert 0 < np.isnan(expected).sum() < len(expected) / 2
    np.testing.assert_array_equal(path.lengths_at(stamps_ns), expected)


def test_headings_of_many_moments_are_those_of_each_to_the_last_bit() -> None:
    path, rng = DrivenPath(CONFIG), np.random.default_rng(0)
    theta = 0.7
    for k in range(50):
        theta += rng.normal(0.0, 0.4)
        path.advance(1_000 + 100_000_007 * k, Pose2(0.01 * k, 0.0, wrap(theta)))
    stamps_ns = np.concatenate([np.arange(0, 5_200_000_000, 33_333_333), 1_000 + 100_000_007 * np.arange(50)])
    points = [path.at(int(stamp_ns)) for stamp_ns in stamps_ns]
    expected = [point.T_path_base.theta if point else math.nan for point in points]
    assert 0 < np.isnan(expected).sum() < len(expected) / 2
    np.testing.assert_array_equal(path.headings_at(stamps_ns), expected)
    assert np.isnan(DrivenPath(CONFIG).headings_at(stamps_ns)).all()


def test_what_a_laser_that_leads_left_open_adds_up_and_loosens_the_motion() -> None:
    path = DrivenPath(CONFIG)
    for k, open_m2 in enumerate([0.0, 0.1, 0.2]):
        path.advance(k * S, Pose2(0.1 * k, 0.0, 0.0), LedStep(open_m2))
    begin, middle, end = (path.at(stamp_ns) for stamp_ns in (0, S // 2, 2 * S))
    assert begin
    assert middle
    assert end
    motion = middle.motion_to(end)
    assert motion.open_m2 == pytest.approx(0.25)
    loosened = wheel_covariance(motion, CONFIG, 2.0) - wheel_covariance(motion._replace(open_m2=0.0), CONFIG, 2.0)
    np.testing.assert_allclose(loosened, np.diag([0.25, 0.25, 0.0]), atol=1e-12)
    assert keyframe_due(motion, CONFIG)
    assert not keyframe_due(motion._replace(open_m2=0.2), CONFIG)


def test_a_step_of_the_laser_that_does_not_fit_may_be_any() -> None:
    path = DrivenPath(CONFIG)
    path.advance(0, Pose2())
    assert path.advance(S, Pose2(0.1, 0.0, 0.0), LedStep(0.25, fits=False))
    begin, end = path.at(0), path.latest
    assert begin
    assert end
    assert begin.motion_to(end).discontinuities == 1


def test_a_step_of_a_laser_that_was_silent_may_be_any_and_its_time_is_kept() -> None:
    path = DrivenPath(CONFIG)
    path.advance(0, Pose2(), LedStep())
    path.advance(2 * S, Pose2(0.1, 0.0, 0.0), LedStep(blind=True))
    path.advance(3 * S, Pose2(0.2, 0.0, 0.0), LedStep())
    begin, middle, end = path.at(0), path.at(2 * S), path.latest
    assert begin
    assert middle
    assert end
    assert begin.motion_to(end).blind_s == 2.0
    assert begin.motion_to(end).discontinuities == 1
    assert middle.motion_to(end).blind_s == 0.0
    assert end.led_s == 3.0
