"""A wall of a scan where a submap's rays went on contradicts it; walls out of its sight do not."""

import math
from dataclasses import replace

import numpy as np
from rooms import HALL, see

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.closures.closure_config import ClosureConfig, OverlapConfig
from wayfi.frontends.closures.lidar_check import CheckResult, Expected, check
from wayfi.frontends.closures.overlap import agreement, seen_through
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.scan_points import ScanPoints
from wayfi.recordings.simulation.surfaces import box

CONFIG = OverlapConfig()
A = Pose2(-1.0, -2.0, 0.0)
SURE = np.diag([0.1**2, 0.1**2, 0.03**2])
AT_ORIGIN = np.zeros((1, 3))


def ahead(scan: ScanPoints, half_rad: float = math.pi / 2) -> ScanPoints:
    """The scan of a laser that sees only what lies ahead."""
    seen = np.abs(np.arctan2(scan.points[:, 1], scan.points[:, 0])) < half_rad
    return replace(scan, points=scan.points[seen], normals=scan.normals[seen])


def looking(faces: Floats, pose: Pose2, seed: int = 0) -> ScanPoints:
    return ahead(see(faces, pose, np.random.default_rng(seed)))


def come_back(faces_then: Floats, faces_now: Floats, covariance: Floats, config: OverlapConfig = CONFIG) -> CheckResult:
    """The check of a laser that sees 180 degrees, where it comes back to A looking 115 degrees to the side."""
    ways = [Pose2(0.5 * k, 0.0, 0.0) for k in range(-2, 3)]
    scans = [looking(faces_then, A @ way, seed) for seed, way in enumerate(ways)]
    T_a_b = Pose2(0.3, 0.4, 2.0)
    poses = np.array([way.array() for way in ways])
    scan = looking(faces_now, A @ T_a_b, 9)
    done = check(scan, scans, poses, Expected(T_a_b, covariance), ClosureConfig(overlap=config), LidarConfig())
    assert done is not None
    return done


def test_a_scan_does_not_contradict_itself() -> None:
    scan = looking(HALL, A)
    assert seen_through(scan, Pose2(), [scan], AT_ORIGIN, CONFIG) == 0


def test_what_stands_where_rays_passed_is_seen_through() -> None:
    before, now = looking(HALL, A), looking(np.concatenate([HALL, box(0.5, -2.5, 1.5, -1.5)]), A)
    near = np.hypot(*now.points.T) < 2.5
    through = seen_through(now, Pose2(), [before], AT_ORIGIN, CONFIG)
    assert 10 < through <= near.sum()
    assert agreement(1 - near.mean(), now, Pose2(), [before], AT_ORIGIN, CONFIG) < 1.0


def test_what_is_behind_a_wall_or_out_of_sight_is_not_seen_through() -> None:
    before = looking(HALL, A)
    behind, beyond = looking(HALL, A @ Pose2(0, 0, math.pi)), looking(box(-30.0, -30.0, 30.0, 30.0), A)
    assert seen_through(behind, Pose2(0, 0, math.pi), [before], AT_ORIGIN, CONFIG) == 0
    assert seen_through(beyond, Pose2(), [before], AT_ORIGIN, CONFIG) == 0


def test_a_laser_that_sees_half_of_a_place_closes_a_loop_looking_another_way() -> None:
    done = come_back(HALL, HALL, SURE)
    assert done.inlier_ratio < ClosureConfig().min_inlier_ratio
    assert done.refused == ""
    assert done.T_a_b.distance(Pose2(0.3, 0.4, 2.0)) < 0.02


def test_an_uncertain_estimate_asks_for_more_of_the_points() -> None:
    assert come_back(HALL, HALL, 25 * SURE).refused.startswith("inlier ratio")


def test_walls_that_were_seen_through_refuse_it() -> None:
    moved_in = np.concatenate([HALL, box(-0.8, 0.5, 1.5, 0.7)])
    few = replace(CONFIG, min_inlier_ratio=0.1)
    assert "of those in sight" in come_back(HALL, moved_in, SURE, few).refused
    assert come_back(HALL, moved_in, SURE, replace(few, min_agreement=0.1)).refused == ""
