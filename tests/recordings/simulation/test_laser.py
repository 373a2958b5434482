"""The ranges of an ideal laser, against geometry."""

import math

import numpy as np
import pytest
from rooms import distances_m, faces_at

from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.measurements import LaserScan, StaticTransforms
from wayfi.recordings.simulation import laser, surfaces
from wayfi.recordings.simulation.run import EPOCH_NS, measurements, start
from wayfi.recordings.simulation.worlds import World

CAR_PARK = start(World.CARPARK, seed=0)


def in_a_box(pose: Pose2) -> Floats:
    room = surfaces.still(surfaces.box(-3.0, -2.0, 5.0, 4.0))
    return laser.ranges(room, pose.array()[None], np.zeros(1))[0]


def bearings(pose: Pose2) -> Floats:
    return np.asarray(pose.theta + laser.UST_20LX.bearings)


@pytest.mark.parametrize("pose", [Pose2(), Pose2(1.0, -1.0, 2.5), Pose2(4.0, 3.5, -3.1)], ids=str)
def test_ranges_in_a_box_are_those_of_geometry(pose: Pose2) -> None:
    with np.errstate(divide="ignore"):
        to_x = np.where(np.cos(bearings(pose)) > 0, 5.0 - pose.x, -3.0 - pose.x) / np.cos(bearings(pose))
        to_y = np.where(np.sin(bearings(pose)) >= 0, 4.0 - pose.y, -2.0 - pose.y) / np.sin(bearings(pose))
    np.testing.assert_allclose(in_a_box(pose), np.minimum(to_x, to_y), rtol=1e-9)


def straight_ahead_m(shape: surfaces.Surfaces, time_s: float = 0.0) -> float:
    """The range from the origin along x."""
    return float(laser.ranges(shape, np.zeros((1, 3)), np.array([time_s]))[0, laser.UST_20LX.beams // 2])


def test_nothing_within_range_is_no_return() -> None:
    assert straight_ahead_m(surfaces.still(np.array([[20.1, -1.0, 20.1, 1.0]]))) == math.inf
    assert straight_ahead_m(surfaces.still(np.array([[19.9, -1.0, 19.9, 1.0]]))) == pytest.approx(19.9)


def test_what_moves_is_where_it_is_now() -> None:
    car = surfaces.moving(np.array([[5.0, -1.0, 5.0, 1.0]]), since_s=10.0, until_s=14.0, velocity_xy=(1.0, 0.0))
    assert straight_ahead_m(car, 9.9) == math.inf
    assert straight_ahead_m(car, 13.0) == pytest.approx(8.0)
    assert straight_ahead_m(car, 14.0) == math.inf
    np.testing.assert_allclose(faces_at(car, 13.0), [[8.0, -1.0, 8.0, 1.0]])


def test_noise_is_one_to_three_centimetres() -> None:
    run = start(World.OFFICE, 0, minutes=0.5, rough=False)
    times_s = np.arange(0.0, 30.0, 1.0)
    poses = compose_all(run.drive.poses(times_s), np.array([0.2, 0.0, 0.0]))
    exact = laser.ranges(run.surfaces, poses, times_s)
    noisy = laser.scans(run.surfaces, poses, times_s, np.random.default_rng(1))
    error = noisy[exact < 19.5] - exact[exact < 19.5]
    assert abs(error.mean()) < 0.001
    assert 0.01 < error.std() < 0.03


def test_scans_are_seen_from_the_laser_in_front_of_the_base() -> None:
    run = start(World.OFFICE, 0, minutes=0.1, rough=False)
    received = list(measurements(run))
    transforms = next(m for m in received if isinstance(m, StaticTransforms)).transforms
    scan = next(m for m in received if isinstance(m, LaserScan))
    assert transforms[0].child_frame_id == scan.frame_id == "laser"
    T_base_laser = Pose2(*transforms[0].translation_xyz[:2], 0.0)
    T_map_base = Pose2.of(run.drive.poses(np.array([(scan.stamp_ns - EPOCH_NS) / 1e9]))[0])
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    hit = np.flatnonzero(np.isfinite(scan.ranges))[::20]
    hits = scan.ranges[hit, None] * np.column_stack([np.cos(angles[hit]), np.sin(angles[hit])])
    seen = (T_map_base @ T_base_laser).transform(hits)
    assert distances_m(seen, faces_at(run.surfaces, 0.0)).max() < 0.12
