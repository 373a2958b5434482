"""The wide search: any heading, some metres around; one place, or none."""

import math

import numpy as np
import pytest
from rooms import CORRIDOR, HALL, LIDAR, LOOK_ALIKE, see, see_near

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.lidar.point_index import PointIndex
from wayfi.frontends.lidar.relocation import Sight, has_rival, relocate
from wayfi.frontends.lidar.scan_matching import merge_submap
from wayfi.recordings.simulation.surfaces import box

SQUARE = box(-3.0, -3.0, 3.0, 3.0)
ROUND = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, math.pi]])
PATH = np.array([[-4.5 + 0.5 * k, -2.5, 0.0] for k in range(14)])


def submap(faces: Floats, path: Floats) -> PointIndex:
    rng = np.random.default_rng(0)
    merged = merge_submap([see(faces, Pose2.of(pose), rng) for pose in path], path, LIDAR.cell_m)
    assert merged is not None
    return merged


def found(faces: Floats, path: Floats, truth: Pose2, guess: Pose2) -> Pose2 | None:
    scan = see(faces, truth, np.random.default_rng(1))
    result = relocate(scan, submap(faces, path), guess, LIDAR)
    return result.T_target_scan if result else None


@pytest.mark.parametrize("theta", [0.3, 1.4, -1.6, 2.6, math.pi, -3.1])
def test_a_robot_that_turned_by_any_angle_is_found(theta: float) -> None:
    truth = Pose2(0.0, -2.0, theta)
    T = found(HALL, PATH, truth, Pose2(1.0, -2.5, 0.0))
    assert T is not None
    assert T.distance(truth) < 0.02
    assert abs(wrap(T.theta - truth.theta)) < math.radians(0.3)


def test_a_place_beyond_the_window_is_not_found() -> None:
    assert found(HALL, PATH, Pose2(7.5, 3.5, 1.0), Pose2(-4.0, -2.5, 0.0)) is None


@pytest.mark.parametrize(("faces", "path"), [(SQUARE, ROUND), (CORRIDOR, ROUND)])
def test_where_several_places_fit_none_is_found(faces: Floats, path: Floats) -> None:
    assert found(faces, path, Pose2(0.5, 0.3, 0.2), Pose2()) is None


@pytest.mark.parametrize(("faces", "reach_m", "rivals"), [(HALL, 30.0, False), (LOOK_ALIKE, 6.0, True)])
def test_the_room_next_door_that_was_not_seen_is_a_rival(faces: Floats, reach_m: float, rivals: bool) -> None:
    rng, start = np.random.default_rng(0), Pose2(0.0, 1.0 if rivals else -2.5, 0.0)
    ways = np.array([[0.5 * k, 0.0, 0.0] for k in range(-4, 6)])
    scans = [see_near(faces, start @ Pose2.of(way), rng, reach_m) for way in ways]
    merged = merge_submap(scans, ways, LIDAR.cell_m)
    assert merged is not None
    truth = Pose2(2.2, 0.1, 0.0)
    scan = see_near(faces, start @ truth, rng, reach_m)
    assert has_rival(scan, merged, Sight(scans, ways), truth, LIDAR) is rivals
