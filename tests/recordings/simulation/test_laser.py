"""The ranges of a laser, at rest and while it moves, against geometry."""

import math

import numpy as np
import pytest
from rooms import distances_m, faces_at

from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.measurements import LaserScan, StaticTransforms
from wayfi.recordings.simulation import laser, surfaces
from wayfi.recordings.simulation.laser import UST_20LX, Sweeps
from wayfi.recordings.simulation.robots.models import Robot
from wayfi.recordings.simulation.run import EPOCH_NS, Run, measurements, scans, start
from wayfi.recordings.simulation.surfaces import Surfaces
from wayfi.recordings.simulation.worlds.blueprints import World

ROOM = surfaces.box(-3.0, -2.0, 5.0, 4.0)


def in_a_box(pose: Pose2) -> Floats:
    room = surfaces.still(surfaces.box(-3.0, -2.0, 5.0, 4.0))
    return laser.ranges(room, pose.array()[None], np.zeros(1))[0]


def bearings(pose: Pose2) -> Floats:
    return np.asarray(pose.theta + UST_20LX.bearings)


@pytest.mark.parametrize("pose", [Pose2(), Pose2(1.0, -1.0, 2.5), Pose2(4.0, 3.5, -3.1)], ids=str)
def test_ranges_in_a_box_are_those_of_geometry(pose: Pose2) -> None:
    with np.errstate(divide="ignore"):
        to_x = np.where(np.cos(bearings(pose)) > 0, 5.0 - pose.x, -3.0 - pose.x) / np.cos(bearings(pose))
        to_y = np.where(np.sin(bearings(pose)) >= 0, 4.0 - pose.y, -2.0 - pose.y) / np.sin(bearings(pose))
    np.testing.assert_allclose(in_a_box(pose), np.minimum(to_x, to_y), rtol=1e-9)


def straight_ahead_m(shape: surfaces.Surfaces, time_s: float = 0.0) -> float:
    """The range from the origin along x."""
    return float(laser.ranges(shape, np.zeros((1, 3)), np.array([time_s]))[0, UST_20LX.beams // 2])


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
    run = start(World.OFFICE, 0, minutes=0.5, robot=Robot.IDEAL)
    times_s = np.arange(0.0, 30.0, 1.0)
    poses = compose_all(run.drive.poses(times_s), np.array([0.2, 0.0, 0.0]))
    exact = laser.ranges(run.surfaces, poses, times_s)
    noisy = laser.scans(run.surfaces, poses, times_s, np.random.default_rng(1))
    error = noisy[exact < 19.5] - exact[exact < 19.5]
    assert abs(error.mean()) < 0.001
    assert 0.01 < error.std() < 0.03


def test_scans_are_seen_from_the_laser_in_front_of_the_base() -> None:
    run = start(World.OFFICE, 0, minutes=0.1, robot=Robot.IDEAL)
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


def swept(scene: Surfaces, first: Pose2, last: Pose2, time_s: float = 0.0) -> Floats:
    """(beams,) ranges of one sweep from `first` to `last`."""
    poses = (first.array()[None], last.array()[None])
    return laser.hits(scene, Sweeps(np.array([time_s]), *poses, UST_20LX.sweep_s), UST_20LX).range_m[0]


def beam_poses(first: Pose2, last: Pose2) -> Floats:
    """(beams, 3) where the laser is at each beam's moment."""
    share = np.linspace(0.0, 1.0, UST_20LX.beams)[:, None]
    return first.array() + share * (last.array() - first.array())


def points(poses: Floats, range_m: Floats) -> Floats:
    bearing = poses[:, 2] + UST_20LX.bearings
    return np.asarray(poses[:, :2] + range_m[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1))


@pytest.mark.parametrize("turn", [0.0, 0.3, -0.3])
def test_each_beam_is_cast_from_where_the_laser_is_then(turn: float) -> None:
    first, last = Pose2(0.5, -1.0, 0.4), Pose2(0.7, -0.8, 0.4 + turn)
    range_m = swept(surfaces.still(ROOM), first, last)
    assert distances_m(points(beam_poses(first, last), range_m), ROOM).max() < 1e-9
    assert np.isfinite(range_m).all()
    as_if_at_once = points(np.tile(first.array(), (UST_20LX.beams, 1)), range_m)
    assert distances_m(as_if_at_once, ROOM).max() > 0.1


def test_small_faces_are_met_by_all_their_beams_in_a_sweep() -> None:
    """A room in pieces looks like the room."""
    first, last = Pose2(0.5, -1.0, 0.4), Pose2(0.6, -0.9, 0.2)
    corners = np.vstack([np.linspace(face[:2], face[2:], 40, endpoint=False) for face in ROOM])
    pieces = surfaces.still(surfaces.polygon(corners))
    np.testing.assert_allclose(swept(pieces, first, last), swept(surfaces.still(ROOM), first, last), atol=1e-9)


def test_what_moves_goes_on_during_the_sweep() -> None:
    here = Pose2()
    wall = surfaces.moving(np.array([[2.0, -50.0, 2.0, 50.0]]), 0.0, 9.0, velocity_xy=(10.0, 0.0))
    range_m = swept(wall, here, here, time_s=0.1)
    ahead = np.abs(UST_20LX.bearings) < 0.5
    moment_s = 0.1 + UST_20LX.time_increment_s * np.arange(UST_20LX.beams)
    along_x = range_m * np.cos(UST_20LX.bearings)
    np.testing.assert_allclose(along_x[ahead], 2.0 + 10.0 * moment_s[ahead], atol=1e-9)


def test_a_turn_of_the_mirror_takes_25_ms() -> None:
    assert UST_20LX.time_increment_s * 1440 == pytest.approx(0.025)
    assert {scan.time_increment_s for scan in scans(start(World.OFFICE, 0, 0.1))} == {UST_20LX.time_increment_s}
    assert {scan.time_increment_s for scan in scans(start(World.OFFICE, 0, 0.1, robot=Robot.IDEAL))} == {0.0}


def turning_scans(run: Run, turns_over_rad_s: float) -> list[LaserScan]:
    ends_s = run.length_ns / 1e9
    scan_list = list(scans(run))
    time_s = np.array([(scan.stamp_ns - EPOCH_NS) / 1e9 for scan in scan_list])
    theta = np.unwrap(run.drive.poses(np.minimum(np.stack([time_s, time_s + 0.1]), ends_s).ravel())[:, 2])
    rate = np.abs(np.diff(theta.reshape(2, -1), axis=0)[0]) / 0.1
    return [scan for scan, r in zip(scan_list, rate, strict=True) if r > turns_over_rad_s]


def test_points_of_a_turning_scan_fall_on_the_walls_at_the_stated_times() -> None:
    run = start(World.OFFICE, 0, minutes=2.8)
    turning = turning_scans(run, 0.5)[::5]
    assert len(turning) >= 4
    off: dict[bool, list[float]] = {True: [], False: []}
    for scan in turning:
        first_s, beam = (scan.stamp_ns - EPOCH_NS) / 1e9, np.arange(len(scan.ranges))
        hit = np.isfinite(scan.ranges) & (scan.ranges > 3.0) & (scan.ranges < 10.0)
        for in_time in (True, False):
            moment_s = first_s + in_time * scan.time_increment_s * beam
            poses = compose_all(run.drive.poses(moment_s), run.T_base_laser.array())
            walls = faces_at(run.surfaces.where(~run.surfaces.moves), first_s)
            off[in_time].append(float(np.median(distances_m(points(poses, scan.ranges)[hit], walls))))
    assert np.mean(off[True]) < 0.012
    assert np.mean(off[False]) > 1.5 * np.mean(off[True])
