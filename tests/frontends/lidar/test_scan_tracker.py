"""Scan matching from keyframe to keyframe, and trust in wheels that follows what the laser finds."""

import math

import numpy as np
import pytest
from rooms import CORRIDOR, HALL, see

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.keyframes import Keyframe, Keyframes
from wayfi.frontends.lidar.doubt import Finding
from wayfi.frontends.lidar.icp import IcpResult
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.point_index import PointIndex
from wayfi.frontends.lidar.relocation import relocate
from wayfi.frontends.lidar.scan_tracker import KeyframeMatch, ScanTracker
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.wheel_noise import wheel_covariance
from wayfi.frontends.scan_points import ScanPoints

LIDAR, ODOMETRY = LidarConfig(), OdometryConfig()
START = Pose2(-4.5, -2.5, 0.0)
STEP = Pose2(0.3, 0.0, 0.05)


def follow(
    steps: int, wrong: Pose2, seed: int = 0, scanless: bool = False
) -> tuple[ScanTracker, list[KeyframeMatch | None]]:
    """Drive in the hall; the wheels tell each step multiplied by `wrong`. The poses are where the matches lead."""
    rng, keyframes = np.random.default_rng(seed), Keyframes()
    tracker = ScanTracker(keyframes, LIDAR, ODOMETRY)
    truth, told, poses, tracked = START, Pose2(), [np.zeros(3)], []
    first = None if scanless else see(HALL, truth, rng)
    keyframes.append(Keyframe(PathPoint(0, told, 0.0), first))
    for k in range(1, steps + 1):
        truth, said = truth @ STEP, STEP @ wrong
        point = PathPoint(k * 10**9, told @ said, k * 0.3)
        motion, scan = keyframes[k - 1].point.motion_to(point), see(HALL, truth, rng)
        tracked.append(tracker.match(scan, motion, motion.pose, np.array(poses)))
        last = tracked[-1]
        poses.append((Pose2.of(poses[-1]) @ (last.match.T_submap_scan if last else motion.pose)).array())
        keyframes.append(Keyframe(point, None if scanless else scan))
        told = point.T_path_base
    return tracker, tracked


def test_each_keyframe_is_matched_to_the_ones_before_it() -> None:
    _, tracked = follow(12, Pose2(0.02, 0.0, 0.02))
    for one in tracked:
        assert one is not None
        T = one.match.T_submap_scan
        assert T.distance(STEP) < 0.015
        assert abs(wrap(T.theta - STEP.theta)) < math.radians(0.2)
        assert one.match.inlier_ratio > 0.8
        assert one.submap.shape[1] == 2


def test_the_drive_does_not_bend() -> None:
    _, tracked = follow(15, Pose2(0.03, 0.0, 0.03))
    T, truth = Pose2(), Pose2()
    for one in tracked:
        assert one is not None
        T, truth = T @ one.match.T_submap_scan, truth @ STEP
    assert T.distance(truth) < 0.05
    assert abs(wrap(T.theta - truth.theta)) < 0.01


def test_good_wheels_earn_their_trust() -> None:
    tracker, _ = follow(25, Pose2())
    assert tracker.covariance_scale == 1.0


def test_wheels_that_slip_lose_it_and_their_covariance_grows() -> None:
    tracker, tracked = follow(25, Pose2(0.1, 0.03, 0.1))
    assert tracker.covariance_scale > 2 * LIDAR.trust.initial
    assert all(one is not None and one.match.T_submap_scan.distance(STEP) < 0.03 for one in tracked)
    motion = WheelMotion(STEP, 0.3, 1.0)
    ratio = tracker.wheel_covariance(motion)[0, 0] / wheel_covariance(motion, ODOMETRY)[0, 0]
    np.testing.assert_allclose(ratio, tracker.covariance_scale)


def test_trust_stays_within_its_bounds_whatever_the_wheels_say() -> None:
    tracker, _ = follow(25, Pose2(0.6, 0.0, 0.3))
    assert 1.0 <= tracker.covariance_scale <= LIDAR.trust.most


def judged_in_a_crowd(hidden: float, wrong: Pose2) -> tuple[KeyframeMatch, Pose2]:
    """A scan of which people hide a share of the walls, and by how much the wheels err then."""
    rng, keyframes = np.random.default_rng(0), Keyframes()
    keyframes.append(Keyframe(PathPoint(0, Pose2(), 0.0), see(HALL, START, rng)))
    seen = see(HALL, START @ STEP, rng)
    crowd = rng.random(len(seen.points)) < hidden
    scan = ScanPoints(np.where(crowd[:, None], 0.5 * seen.points, seen.points), seen.normals, seen.T_base_laser)
    motion = WheelMotion(STEP @ wrong, 0.3, 1.0)
    tracked = ScanTracker(keyframes, LIDAR, ODOMETRY).match(scan, motion, motion.pose, np.zeros((1, 3)))
    assert tracked is not None
    assert tracked.match.inlier_ratio < LIDAR.min_inlier_ratio
    assert tracked.judged.finding is Finding.UNFIT
    return tracked, motion.pose


def test_a_scan_that_nearly_fits_tells_by_how_much_the_wheels_may_have_erred() -> None:
    tracked, wheels = judged_in_a_crowd(0.52, Pose2(0.05, 0.02, 0.1))
    assert tracked.match.inlier_ratio > LIDAR.doubt.nearly * LIDAR.min_inlier_ratio
    sigma_m, sigma_rad = np.sqrt(np.diag(tracked.judged.covariance))[[0, 2]]
    np.testing.assert_allclose(sigma_m, abs(wheels.x - STEP.x), atol=0.01)
    np.testing.assert_allclose(sigma_rad, 0.1, atol=0.01)


def test_a_scan_that_does_not_fit_tells_nothing_of_the_wheels() -> None:
    tracked, _ = judged_in_a_crowd(0.8, Pose2(0.05, 0.02, 0.1))
    assert tracked.match.inlier_ratio < LIDAR.doubt.nearly * LIDAR.min_inlier_ratio
    assert not tracked.judged.covariance.any()


def somebody(at: Pose2) -> tuple[Floats, Floats]:
    """(60, 2) points (m) and normals of somebody who stands and turns `at` in base_link."""
    off = 0.08 * np.random.default_rng(1).standard_normal((60, 2))
    normals = Pose2(0.0, 0.0, at.theta).transform(off / np.linalg.norm(off, axis=1, keepdims=True))
    return at.transform(off), normals


def matched_after(before: ScanPoints, scan: ScanPoints) -> KeyframeMatch:
    """The match of `scan` half a metre on by wheels that are sure."""
    keyframes, motion, poses = Keyframes(), WheelMotion(Pose2(0.5), 0.5, 1.0), np.zeros((1, 3))
    keyframes.append(Keyframe(PathPoint(0, Pose2(), 0.0), before))
    tracker = ScanTracker(keyframes, LIDAR, ODOMETRY)
    tracker.match(before, WheelMotion(Pose2(), 0.0, 1.0), Pose2(), poses)  # the scale begins
    tracker.covariance_scale = 1.0
    tracked = tracker.match(scan, motion, motion.pose, poses)
    assert tracked is not None
    assert tracked.match.inlier_ratio > LIDAR.min_inlier_ratio
    return tracked


def hall_and_somebody() -> ScanPoints:
    """The hall with somebody in front of its walls."""
    hall, (points, normals) = see(HALL, START, np.random.default_rng(0)), somebody(Pose2(0.55, 0.12, 0.3))
    return ScanPoints(np.vstack([hall.points, points]), np.vstack([hall.normals, normals]), Pose2())


def test_sure_wheels_are_believed_where_somebody_hides_all_but_himself() -> None:
    tracked = matched_after(hall_and_somebody(), ScanPoints(*somebody(Pose2(0.25)), Pose2()))
    assert tracked.match.T_submap_scan.distance(Pose2(0.5)) > LIDAR.doubt.slip_m
    assert tracked.refused
    assert tracked.judged.finding is Finding.UNFIT
    assert not tracked.judged.covariance.any()


def test_walls_are_believed_where_wheels_slip() -> None:
    tracked = matched_after(hall_and_somebody(), see(HALL, START @ Pose2(0.3, 0.1), np.random.default_rng(2)))
    assert not tracked.refused
    assert tracked.judged.finding is Finding.SLIPPED


def test_walls_that_leave_the_way_open_are_believed_of_a_turn() -> None:
    rng, truth = np.random.default_rng(0), Pose2(0.5, 0.0, 0.2)
    tracked = matched_after(see(CORRIDOR, Pose2(), rng), see(CORRIDOR, truth, rng))
    assert not tracked.refused
    assert abs(tracked.match.T_submap_scan.theta - truth.theta) < 0.01


def test_without_a_submap_or_points_there_is_no_match_and_nothing_is_learnt() -> None:
    tracker, tracked = follow(3, Pose2(), scanless=True)
    assert tracked == [None] * 3
    assert tracker.covariance_scale == LIDAR.trust.initial

    keyframes = Keyframes()
    keyframes.append(Keyframe(PathPoint(0, Pose2(), 0.0), see(HALL, START, np.random.default_rng(0))))
    few: Floats = np.ones((LIDAR.min_points - 1, 2))
    tracker = ScanTracker(keyframes, LIDAR, ODOMETRY)
    motion = WheelMotion(Pose2(), 0.1, 1.0)
    assert tracker.match(ScanPoints(few, few, Pose2()), motion, Pose2(), np.zeros((1, 3))) is None


def test_keyframes_keep_their_scans_and_paths_as_they_grow() -> None:
    keyframes, scan = Keyframes(), see(HALL, START, np.random.default_rng(0))
    for k in range(200):
        keyframes.append(Keyframe(PathPoint(k, Pose2(), 0.5 * k), scan if k % 3 == 0 else None))
    assert len(keyframes) == 200
    np.testing.assert_array_equal(keyframes.paths_m, 0.5 * np.arange(200))
    np.testing.assert_array_equal(keyframes.has_scan, np.arange(200) % 3 == 0)
    poses = np.stack([np.arange(200.0), np.zeros(200), np.zeros(200)], axis=1)
    scans, placed = keyframes.scans_around(-5, 10, poses[4], poses)
    np.testing.assert_array_equal(placed[:, 0], [-4, -1, 2, 5])
    assert scans == [scan] * 4
    assert keyframes.scans_around(1, 3, poses[0], poses)[0] == []
    assert keyframes.scans_around(198, 500, poses[0], poses)[1][:, 0].tolist() == [198]
    assert keyframes.newest is keyframes[199]


def test_a_scan_that_was_compared_before_it_becomes_a_keyframe_is_not_searched_twice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    searched = []

    def wide(scan: ScanPoints, submap: PointIndex, guess: Pose2, lidar: LidarConfig) -> IcpResult | None:
        searched.append(scan)
        return relocate(scan, submap, guess, lidar)

    monkeypatch.setattr("wayfi.frontends.lidar.scan_tracker.relocate", wide)
    carried, still = START @ Pose2(1.5, 0.5, 2.0), Pose2()
    rng, keyframes = np.random.default_rng(3), Keyframes()
    keyframes.append(Keyframe(PathPoint(0, still, 0.0), see(HALL, START, rng)))
    motion = keyframes[0].point.motion_to(PathPoint(10**9, still, 0.0))
    scan, another = see(HALL, carried, rng), see(HALL, carried, rng)
    looked, fresh = ScanTracker(keyframes, LIDAR, ODOMETRY), ScanTracker(keyframes, LIDAR, ODOMETRY)
    poses = np.zeros((1, 3))
    for each in (looked, fresh):
        each.match(keyframes[0].scan or scan, motion, still, poses)  # as after the first step: the scale has begun
    looked.compare(scan, motion, still, poses)
    assert len(searched) == 1
    found, expected = looked.match(scan, motion, still, poses), fresh.match(scan, motion, still, poses)
    assert found is not None
    assert expected is not None
    assert found.match.T_submap_scan == expected.match.T_submap_scan
    assert len(searched) == 2  # by the fresh one alone
    looked.match(another, motion, still, poses)
    assert len(searched) == 3
