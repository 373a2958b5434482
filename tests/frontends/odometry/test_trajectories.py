"""The trajectory of a drive: it meets the keyframes, and between them it is what the wheels said."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.pose2 import Floats, Pose2, between_all, compose_all
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.trajectories import Trajectories

S = 1_000_000_000


def driven(n: int, seed: int = 0, pause: range = range(0)) -> list[PathPoint]:
    """Points ten times a second of a robot that drives in bends, and stands still at the points of `pause`."""
    rng, T, path = np.random.default_rng(seed), Pose2(), 0.0
    points = [PathPoint(0, T, 0.0)]
    for k in range(1, n):
        step = Pose2() if k in pause else Pose2(*rng.uniform(0, 0.1, 2), rng.uniform(-0.2, 0.2))
        T, path = T @ step, path + float(np.hypot(step.x, step.y))
        points.append(PathPoint(k * S // 10, T, path))
    return points


def trajectories(points: list[PathPoint], offset: Pose2 | None = None) -> Trajectories:
    out = Trajectories()
    for point in points:
        out.add(point, (offset or Pose2()) @ point.T_path_base)
    return out


def poses_of(points: list[PathPoint]) -> Floats:
    return np.array([point.T_path_base.array() for point in points])


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**31), st.integers(1, 6))
def test_it_meets_the_poses_of_the_keyframes_wherever_these_are(seed: int, every: int) -> None:
    points = driven(25, seed)
    keyframes = points[::every]
    moved = np.random.default_rng(seed + 1).uniform(-3, 3, (len(keyframes), 3))
    final = trajectories(points).final(keyframes, moved, np.array([0.01, 0.02, 0.03, 0.001]))
    np.testing.assert_allclose(between_all(moved, final[::every]), 0, atol=1e-9)


def test_without_corrections_and_calibration_it_is_the_wheels_path() -> None:
    points = driven(40)
    final = trajectories(points).final(points[::5], poses_of(points[::5]), np.zeros(4))
    np.testing.assert_allclose(between_all(poses_of(points), final), 0, atol=1e-9)


def test_a_map_turned_as_a_whole_turns_the_trajectory_as_a_whole() -> None:
    points, T = driven(40), np.array([5.0, -2.0, 1.5])
    final = trajectories(points).final(points[::5], compose_all(T, poses_of(points[::5])), np.zeros(4))
    np.testing.assert_allclose(between_all(compose_all(T, poses_of(points)), final), 0, atol=1e-9)


def test_the_calibration_bends_what_no_keyframe_holds() -> None:
    straight = [PathPoint(k * S, Pose2(0.5 * k, 0.0, 0.0), 0.5 * k) for k in range(21)]
    final = trajectories(straight).final(straight[:1], np.zeros((1, 3)), np.array([0.0, 0.0, 0.02, 0.0]))
    np.testing.assert_allclose(final[-1, 2], 0.2, atol=1e-9)
    assert final[-1, 1] == pytest.approx(10.0 * 0.1, abs=0.01)


def test_a_correction_is_spread_over_the_way_and_takes_no_leap() -> None:
    points = [PathPoint(k * S // 10, Pose2(0.1 * k, 0.0, 0.0), 0.1 * k) for k in range(11)]
    keyframes = [points[0], points[-1]]
    final = trajectories(points).final(keyframes, np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.0]]), np.zeros(4))
    np.testing.assert_allclose(final[:, 1], np.linspace(0, 0.5, 11), atol=1e-9)
    np.testing.assert_allclose(final[:, 0], np.linspace(0, 1.0, 11), atol=1e-9)


def test_while_the_robot_stands_a_correction_comes_with_time() -> None:
    points = driven(20, pause=range(5, 16))
    keyframes = [points[5], points[15]]
    poses = poses_of(keyframes) + np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    final = trajectories(points).final(keyframes, poses, np.zeros(4))
    steps = np.hypot(*np.diff(final[5:16, :2], axis=0).T)
    np.testing.assert_allclose(steps, 0.01, atol=1e-6)


def test_before_the_first_and_after_the_last_keyframe_the_wheels_lead_on() -> None:
    points = driven(30)
    keyframes = points[10:21:10]
    final = trajectories(points).final(keyframes, poses_of(keyframes), np.zeros(4))
    np.testing.assert_allclose(between_all(poses_of(points)[10:], final[10:]), 0, atol=1e-9)
    assert np.isfinite(final).all()


def test_what_was_published_is_kept_as_it_was() -> None:
    points, offset = driven(10), Pose2(1.0, 2.0, 3.0)
    kept = trajectories(points, offset)
    assert len(kept) == 10
    np.testing.assert_array_equal(kept.stamps_ns(), [point.stamp_ns for point in points])
    np.testing.assert_array_equal(kept.online(), [(offset @ point.T_path_base).array() for point in points])


def test_a_drive_that_never_began_has_no_trajectory() -> None:
    assert Trajectories().stamps_ns().shape == (0,)
    assert Trajectories().online().shape == (0, 3)


def test_the_way_that_a_robot_was_carried_bends_nothing_before() -> None:
    points = [PathPoint(k * S // 10, Pose2(0.1 * k, 0.0, 0.0), 0.1 * k) for k in range(21)]
    poses = np.array([[0.0, 0.0, 0.0], [5.0, 3.0, 1.0], [5.54, 3.84, 1.0]])
    final = trajectories(points).final(points[::10], poses, np.zeros(4), moved_to=[1])
    np.testing.assert_allclose(final[:10, 0], np.linspace(0, 0.9, 10), atol=1e-9)
    np.testing.assert_allclose(final[:10, 1:], 0.0, atol=1e-9)
    np.testing.assert_allclose(final[[10, 20]], poses[1:], atol=1e-9)
