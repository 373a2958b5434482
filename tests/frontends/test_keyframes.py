"""When a keyframe is due, which one a moment belongs to, and those of a map that the drive goes on with."""

import numpy as np
import pytest

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.keyframes import Keyframe, Keyframes, keyframe_due
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.trajectories import Trajectories
from wayfi.frontends.scan_points import ScanPoints

CONFIG = OdometryConfig()
SCAN = ScanPoints(np.ones((1, 2)), np.ones((1, 2)), Pose2())


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


def test_keyframes_with_scans_move_to_where_the_robot_was_later() -> None:
    keyframes, trajectories = Keyframes(), Trajectories()
    for second in range(9):
        trajectories.add(PathPoint(second * SECOND_NS, Pose2(float(second)), float(second)), None)
    for second, scan in ((0, None), (2, SCAN), (4, SCAN)):
        keyframes.append(Keyframe(PathPoint(second * SECOND_NS, Pose2(float(second)), float(second)), scan))
    moved = keyframes.shift(SECOND_NS // 2, trajectories)
    assert moved == {1: 5 * SECOND_NS // 2, 2: 9 * SECOND_NS // 2}
    assert keyframes.paths_m.tolist() == [0.0, 2.5, 4.5]


@pytest.mark.parametrize("shift_s", [-3, -2, -1, 1, 2, 3])
def test_keyframes_that_move_keep_their_order_and_what_counts_along_the_path(shift_s: int) -> None:
    """The drive is known for ten seconds; keyframe 3 has no scan, and stays where it is."""
    keyframes, trajectories = Keyframes(), Trajectories()
    points = [PathPoint(s * SECOND_NS, Pose2(float(s)), float(s), s // 5, 0.1 * s, 0.2 * s, 0.3 * s) for s in range(11)]
    for point in points:
        trajectories.add(point, None)
        keyframes.append(Keyframe(point, SCAN if len(keyframes) != 3 else None))
    stamps_ns = [keyframe.point.stamp_ns for keyframe in keyframes]
    moved = keyframes.shift(shift_s * SECOND_NS, trajectories)
    after_ns = [keyframe.point.stamp_ns for keyframe in keyframes]
    assert (np.diff(after_ns) > 0).all()
    assert (np.diff(keyframes.paths_m) > 0).all()
    assert {k: ns for k, ns in enumerate(after_ns) if ns != stamps_ns[k]} == moved
    assert moved
    for keyframe, before in zip(keyframes, points, strict=True):
        assert keyframe.point[3:] == before[3:]


def test_a_drive_that_is_not_found_in_its_map_reaches_none_of_it() -> None:
    keyframes = Keyframes()
    known = [Keyframe(PathPoint(k, Pose2(), k - 20.0), SCAN) for k in range(4)]
    keyframes.begin_with(known, [0, 0, 1, 1], [2])
    keyframes.append(Keyframe(PathPoint(9, Pose2(), 0.0), SCAN))
    assert keyframes.first == 4
    assert keyframes.own == [keyframes.newest]
    assert [keyframes.piece(k) for k in range(5)] == [(0, 2), (0, 2), (2, 4), (2, 4), (4, 5)]
    assert keyframes.reachable_scans.tolist() == [False] * 4 + [True]
    assert not keyframes.may_close(3, 4)


def test_once_it_is_found_it_reaches_the_floor_where_it_is() -> None:
    keyframes = Keyframes()
    known = [Keyframe(PathPoint(k, Pose2(), k - 20.0), SCAN) for k in range(4)]
    keyframes.begin_with(known, [0, 0, 1, 1], [2])
    keyframes.append(Keyframe(PathPoint(9, Pose2(), 0.0), SCAN))
    keyframes.join(2)
    assert keyframes.floors.tolist() == [0, 0, 1, 1, 1]
    assert keyframes.reachable_scans.tolist() == [False, False, True, True, True]
    assert keyframes.may_close(3, 4)
    assert not keyframes.may_close(1, 4)


def test_only_the_drives_own_scans_are_forgotten() -> None:
    keyframes = Keyframes()
    keyframes.begin_with([Keyframe(PathPoint(0, Pose2(), -5.0), SCAN)], [0], [])
    keyframes.append(Keyframe(PathPoint(9, Pose2(), 0.0), SCAN))
    keyframes.forget_scans()
    assert keyframes.has_scan.tolist() == [True, False]
