"""KISS-ICP between keyframes: as exact as it says, open along a corridor, and no match where nothing overlaps."""

import numpy as np
import pytest
from clouds import CORRIDOR, HALL, band_at, straight_way

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.cloud.cloud_fit import fit_cloud
from wayfi.frontends.cloud.cloud_odometry import CloudLead, CloudOdometry
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.recordings.simulation.surfaces import Surfaces, box, still

CONFIG = LidarConfig()
STEP = Pose2(0.4, 0.05, 0.1)
WHEELS = np.diag([0.03**2, 0.03**2, 0.02**2])


def off(found: Pose2, true: Pose2) -> Floats:
    return np.array([found.x - true.x, found.y - true.y, wrap(found.theta - true.theta)])


def matches(surfaces: Surfaces, step: Pose2, steps: int, guess_off: Pose2) -> list[tuple[Floats, Floats]]:
    """Errors (3,) of the steps found from a guess that is off, and their covariances (3, 3)."""
    odometry, out = CloudOdometry(CONFIG), []
    for number, pose in enumerate(straight_way(steps, step)):
        tracked = odometry.match(band_at(surfaces, pose, number), number, step @ guess_off, WHEELS)
        assert (tracked is None) == (number == 0)
        if tracked:
            assert tracked.match.inlier_ratio > 0.7
            out.append((off(tracked.match.T_submap_scan, step), tracked.match.covariance))
    return out


def test_steps_in_a_hall_are_found_to_a_centimetre_and_no_better_than_claimed() -> None:
    found = matches(HALL, STEP, 15, Pose2(0.1, -0.08, 0.06))
    errors = np.array([e for e, _ in found])
    assert np.abs(errors).max(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=0.012)
    nees = np.mean([e @ np.linalg.solve(C, e) / 3 for e, C in found])
    assert 0.1 < nees < 2.0


def test_a_corridor_is_open_along_it_and_nowhere_else() -> None:
    for error, covariance in matches(CORRIDOR, Pose2(0.5, 0.0, 0.0), 6, Pose2(0.03, 0.02, 0.01)):
        along, across, turn = np.sqrt(np.diag(covariance))
        assert along > 0.1
        assert across < 0.01
        assert turn < 0.005
        assert abs(error[0]) < 0.06  # the wheels' word, near enough
        assert abs(error[1]) < 0.02


def test_a_corridor_across_the_heading_is_open_across_it() -> None:
    turned = still(CORRIDOR.ends[:, [1, 0, 3, 2]])
    for _, covariance in matches(turned, Pose2(0.0, 0.2, 0.0), 3, Pose2()):
        along, across, _ = np.sqrt(np.diag(covariance))
        assert along < 0.01
        assert across > 0.1


def test_what_does_not_overlap_is_no_match_and_the_map_begins_anew() -> None:
    elsewhere = still(np.vstack([box(20.0, 20.0, 27.0, 24.0), box(22.0, 21.0, 23.0, 22.0)]))
    odometry, there = CloudOdometry(CONFIG), Pose2(24.5, 22.0, 0.0)
    for number in range(2):
        odometry.match(band_at(HALL, Pose2(0.1 * number, 0.0, 0.0), number), number, Pose2(0.1, 0, 0), WHEELS)
    lost = odometry.match(band_at(elsewhere, there, 2), 2, Pose2(0.1, 0.0, 0.0), WHEELS)
    assert lost is not None
    assert lost.match.inlier_ratio < CONFIG.min_inlier_ratio
    again = odometry.match(band_at(elsewhere, there @ STEP, 3), 3, STEP, WHEELS)
    assert again is not None
    assert again.match.inlier_ratio > 0.8
    assert np.abs(off(again.match.T_submap_scan, STEP)).max() < 0.02


def test_a_keyframe_without_a_cloud_begins_a_new_map() -> None:
    odometry = CloudOdometry(CONFIG)
    assert odometry.match(band_at(HALL, Pose2(), 0), 3, STEP, WHEELS) is None
    assert odometry.match(band_at(HALL, STEP, 1), 5, STEP, WHEELS) is None
    assert odometry.match(band_at(HALL, STEP @ STEP, 2), 6, STEP, WHEELS) is not None


def test_nothing_in_common_is_no_information() -> None:
    far = np.array([[500.0, 0.0, 0.5], [500.0, 1.0, 0.5]])
    fit = fit_cloud(band_at(HALL, Pose2(), 0), far, Pose2(), Pose2(), np.eye(3), CONFIG.cloud.fit)
    assert fit.inlier_ratio == 0.0
    assert not fit.information.any()
    assert fit.T_target_scan.distance(Pose2()) == pytest.approx(0.0)


def test_clouds_alone_are_followed_from_standing_still_on() -> None:
    lead, pose, speed = CloudLead(CONFIG), Pose2(), 0.0
    for number in range(40):
        band = band_at(HALL, pose, number)
        found = lead.match(number * 100_000_000, band, np.zeros(len(band)))
        assert found.distance(pose) < 0.04
        assert abs(wrap(found.theta - pose.theta)) < 0.03
        speed = min(speed + 0.03, 0.6)
        pose = pose @ Pose2(0.1 * speed, 0.0, 0.02)


def test_a_cloud_that_shows_nothing_leaves_the_lead_where_it_was() -> None:
    lead = CloudLead(CONFIG)
    first = lead.match(0, band_at(HALL, Pose2(), 0), np.zeros(len(band_at(HALL, Pose2(), 0))))
    assert lead.match(100_000_000, np.empty((0, 3)), np.empty(0)) == first
