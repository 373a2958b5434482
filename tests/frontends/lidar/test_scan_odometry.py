"""Odometry from planar scans: in bare corridors it goes on as before and says how little it knows."""

import math

import numpy as np
import pytest
from rooms import CORRIDOR, HALL, TWO_FOLD, see

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.laser_odometry import LaserOdometry
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.scan_odometry import Led, ScanOdometry
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.scan_points import ScanPoints
from wayfi.recordings.simulation.surfaces import box

CONFIG = LidarConfig()
STEP = Pose2(0.06, 0.0, 0.0)
NICHES = np.concatenate([CORRIDOR, box(1.5, 0.8, 2.0, 1.2), box(3.0, -1.2, 3.4, -0.7), box(5.0, 0.9, 5.5, 1.2)])


def scans(faces: Floats, start: Pose2, count: int, step: Pose2 = STEP, reach_m: float = 8.0) -> list[ScanPoints]:
    """What a laser that reaches so far sees on its way."""
    rng, pose, seen = np.random.default_rng(0), start, []
    for _ in range(count):
        scan = see(faces, pose, rng)
        near = np.hypot(*scan.points.T) < reach_m
        seen.append(ScanPoints(scan.points[near], scan.normals[near], scan.T_base_laser))
        pose = pose @ step
    return seen


def followed(odometry: ScanOdometry, seen: list[ScanPoints], first: int = 0) -> list[Led]:
    """Where ten scans a second lead to."""
    return [odometry.match((first + k) * SECOND_NS // 10, s.points, s) for k, s in enumerate(seen)]


def test_in_a_bare_corridor_it_goes_on_as_before_and_says_that_it_does_not_see() -> None:
    seen = scans(NICHES, Pose2(), 300)
    led = followed(ScanOdometry(CONFIG), seen)
    off_m = abs(led[-1].T_odom_base.x - 299 * STEP.x)
    assert off_m < 1.5
    assert all(step.step.fits for step in led)
    assert math.sqrt(sum(step.step.open_m2 for step in led)) > max(off_m, 1.0)
    points_alone = LaserOdometry(CONFIG)
    assert 299 * STEP.x - [points_alone.match(s.points) for s in seen][-1].x > 5.0


def test_where_walls_fix_the_pose_nothing_is_open() -> None:
    step = Pose2(0.08, 0.0, 0.02)
    led, true = followed(ScanOdometry(CONFIG), scans(HALL, Pose2(-4.0, -2.0, 0.0), 40, step)), Pose2()
    for found in led:
        assert found.T_odom_base.distance(true) < 0.05
        assert found.step.fits
        assert found.step.open_m2 == 0.0
        true = true @ step


def test_a_turn_that_begins_between_two_slow_scans_is_searched_for() -> None:
    turn = Pose2(0.0, 0.0, 0.7)
    (still, turned), odometry = scans(HALL, Pose2(), 2, turn), ScanOdometry(CONFIG)
    odometry.match(0, still.points, still)
    led = odometry.match(SECOND_NS // 2, turned.points, turned)
    assert led.step.fits
    assert led.T_odom_base.theta == pytest.approx(turn.theta, abs=0.01)


def test_the_longer_walls_leave_a_direction_open_the_faster_its_variance_grows() -> None:
    led = followed(ScanOdometry(CONFIG, np.array([0.6, 0.0, 0.0])), scans(CORRIDOR, Pose2(), 41))
    sigmas = np.sqrt(np.cumsum([step.step.open_m2 for step in led]))
    assert sigmas[[20, 40]] == pytest.approx([2.0 * CONFIG.lead.open_m_s, 4.0 * CONFIG.lead.open_m_s])
    assert led[-1].T_odom_base.x == pytest.approx(40 * STEP.x, abs=0.1)


@pytest.mark.parametrize("few", [0, 5])
def test_a_sweep_of_few_points_does_not_fit_and_the_next_one_begins_anew(few: int) -> None:
    odometry, seen = ScanOdometry(CONFIG), scans(HALL, Pose2(), 6, Pose2())
    followed(odometry, seen[:4])
    blind = ScanPoints(seen[4].points[:few], seen[4].normals[:few], Pose2())
    led = odometry.match(SECOND_NS // 2, blind.points, blind)
    assert not led.step.fits
    assert led.step.open_m2 > 0.0


def test_a_sweep_of_another_room_does_not_fit() -> None:
    odometry = ScanOdometry(CONFIG)
    followed(odometry, scans(HALL, Pose2(), 4, Pose2()))
    (elsewhere,) = scans(TWO_FOLD, Pose2(3.2, 2.4, 2.0), 1)
    assert not odometry.match(SECOND_NS // 2, elsewhere.points, elsewhere).step.fits
