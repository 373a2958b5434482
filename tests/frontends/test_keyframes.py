"""When a keyframe is due, and which one a moment belongs to."""

import pytest

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.keyframes import Keyframe, Keyframes, keyframe_due
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig

CONFIG = OdometryConfig()


@pytest.mark.parametrize(("stamp_ns", "number"), [(5, 0), (10, 0), (19, 0), (20, 1), (25, 1), (30, 2), (99, 2)])
def test_a_moment_belongs_to_the_newest_keyframe_before_it(stamp_ns: int, number: int) -> None:
    keyframes = Keyframes()
    for k in range(3):
        keyframes.append(Keyframe(PathPoint(10 * (k + 1), Pose2(), 0.5 * k), None))
    assert keyframes.before(stamp_ns) == number


def motion(metres: float = 0.0, radians: float = 0.0, seconds: float = 0.1) -> WheelMotion:
    return WheelMotion(Pose2(metres, 0.0, radians), abs(metres), seconds)


@pytest.mark.parametrize(
    ("way", "due"),
    [
        (motion(0.51), True),
        (motion(0.49), False),
        (motion(-0.51), True),
        (motion(0.0, 0.51), True),
        (motion(0.0, -0.51), True),
        (motion(0.3, 0.3), False),
        (motion(0.06, 0.0, 10.1), True),
        (motion(0.0, 0.06, 10.1), True),
        (motion(0.06, 0.0, 9.9), False),
        (motion(0.01, 0.01, 1000.0), False),
    ],
)
def test_a_keyframe_is_due_by_path_by_turn_and_by_time_if_the_robot_moved(way: WheelMotion, due: bool) -> None:
    assert keyframe_due(way, CONFIG) is due


def test_a_factor_stretches_the_distance_between_keyframes() -> None:
    assert keyframe_due(motion(0.3), CONFIG, 0.5)
    assert not keyframe_due(motion(0.9), CONFIG, 2.0)


def test_a_robot_that_was_moved_begins_a_piece_of_its_own() -> None:
    keyframes = Keyframes()
    for k in range(6):
        if k in (2, 5):
            keyframes.begin_piece(15.0)
        keyframes.append(Keyframe(PathPoint(k, Pose2(), 0.5 * k), None))
    assert [keyframes.piece(k) for k in range(6)] == [(0, 2), (0, 2), (2, 5), (2, 5), (2, 5), (5, 6)]
    assert keyframes.paths_m.tolist() == [0.0, 0.5, 16.0, 16.5, 17.0, 32.5]
    assert keyframes.moved_to == [2, 5]
    keyframes.move(3, PathPoint(3, Pose2(), 1.6))
    assert keyframes.paths_m[3] == pytest.approx(16.6)
