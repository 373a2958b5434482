"""Millimetres are found by steps that no robot drives, and nothing else is taken for them."""

from hypothesis import given
from hypothesis import strategies as st

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.unit_watch import STEPS, UnitWatch


def converted(watch: UnitWatch, poses: list[Pose2], step_s: float = 0.05) -> tuple[Pose2, list[str]]:
    out = [watch.convert(round(k * step_s * SECOND_NS), pose) for k, pose in enumerate(poses)]
    return out[-1][0], [told for _, told in out if told]


@given(st.floats(0.03, 4.0), st.floats(-0.05, 0.05), st.floats(0.005, 0.2))
def test_millimetres_are_told_once_and_converted(speed: float, turn: float, step_s: float) -> None:
    T, poses = Pose2(300.0, -200.0, 0.0), []
    for _ in range(STEPS + 20):
        poses.append(T)
        T = T @ Pose2(1000 * speed * step_s, 0.0, turn)
    end, told = converted(UnitWatch(1.0), poses, step_s)
    assert len(told) == 1
    assert end == Pose2(1e-3 * poses[-1].x, 1e-3 * poses[-1].y, poses[-1].theta)


@given(st.floats(0.0, 5.0), st.floats(-0.2, 0.2))
def test_metres_are_left_alone(speed: float, turn: float) -> None:
    poses = [Pose2(0.05 * speed * k, 0.0, turn * k) for k in range(60)]
    assert converted(UnitWatch(1.0), poses) == (poses[-1], [])


def test_single_leaps_and_two_sources_in_turn_are_no_millimetres() -> None:
    leaping = [Pose2(0.02 * k + 30.0 * (k // 5), 0.0, 0.0) for k in range(100)]
    in_turn = [Pose2(0.02 * k + 30.0 * (k % 2), 0.0, 0.0) for k in range(100)]
    for poses in (leaping, in_turn):
        assert converted(UnitWatch(1.0), poses) == (poses[-1], [])


def test_a_unit_that_is_configured_is_taken_from_the_first_pose_on() -> None:
    assert converted(UnitWatch(0.001), [Pose2(100.0 * k, 0.0, 0.3) for k in range(30)]) == (Pose2(2.9, 0.0, 0.3), [])


def test_a_stamp_far_ahead_leaves_the_steps_after_it_to_tell() -> None:
    watch, told = UnitWatch(1.0), []
    for k in range(STEPS + 5):
        stamp_ns = k * SECOND_NS // 10 + (3600 * SECOND_NS if k == 1 else 0)
        told.append(watch.convert(stamp_ns, Pose2(50.0 * k, 0.0, 0.0))[1])
    assert sum(bool(text) for text in told) == 1
