"""From beams to points in base_link: geometry, mounts, normals, and the motion of a sweep."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rooms import see

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.intake.scan_intake import ScanIntake
from wayfi.frontends.intake.sweep_sets import SweepSet
from wayfi.frontends.lidar.laser_points import MIN_RANGE_M, beam_points, fit_normals, thin, to_base, valid_beams
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.mount import Mount
from wayfi.frontends.measurements import LaserScan, StaticTransforms, Transform
from wayfi.frontends.odometry.driven_path import DrivenPath
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.timebase import TimeBase
from wayfi.recordings.simulation.surfaces import box

S = 1_000_000_000


def scan(
    ranges: list[float] | Floats, angle_min: float = 0.0, increment: float = 0.1, each_s: float = 0.0
) -> LaserScan:
    return LaserScan(S, "laser", np.asarray(ranges, np.float32), angle_min, increment, 0.05, 30.0, each_s)


def quaternion(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> tuple[float, float, float, float]:
    """x, y, z, w of Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr, cp, sp, cy, sy = (f(a / 2) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def mount(xy: tuple[float, float] = (0.0, 0.0), **angles: float) -> Transform:
    return Transform("base_link", "laser", (*xy, 0.3), quaternion(**angles))


# Beams


@settings(deadline=None)
@given(st.lists(st.floats(0.1, 20.0), min_size=1, max_size=40), st.floats(-3, 3), st.floats(-0.1, 0.1))
def test_beam_i_points_at_angle_min_plus_i_increments(ranges: list[float], angle_min: float, increment: float) -> None:
    beams, points = beam_points(scan(ranges, angle_min, increment), 25.0)
    np.testing.assert_array_equal(beams, np.arange(len(ranges)))
    for i, (r, (x, y)) in enumerate(zip(ranges, points, strict=True)):
        assert math.hypot(x, y) == pytest.approx(r, rel=1e-6)
        bearing = angle_min + i * increment
        np.testing.assert_allclose([x, y], [r * math.cos(bearing), r * math.sin(bearing)], atol=1e-5)


def test_what_is_no_return_is_left_out_and_the_others_keep_their_bearing() -> None:
    ranges = [math.nan, 1.0, math.inf, -1.0, 0.0, 0.04, 2.0, 31.0, 26.0, -math.inf]
    beams, points = beam_points(scan(ranges), 25.0)
    assert beams.tolist() == [1, 6]
    np.testing.assert_allclose(points[1], [2 * math.cos(0.6), 2 * math.sin(0.6)], atol=1e-6)
    assert valid_beams(scan(ranges), 25.0).tolist() == [1, 6]


def test_a_range_max_of_zero_is_one_that_is_not_known() -> None:
    unknown = LaserScan(0, "laser", np.array([5.0, 30.0], np.float32), 0.0, 0.1, 0.0, 0.0)
    assert valid_beams(unknown, 25.0).tolist() == [0]
    assert valid_beams(scan([MIN_RANGE_M / 2, 1.0]), 25.0).tolist() == [1]


# Mounts


@settings(deadline=None)
@given(
    st.floats(-3, 3), st.sampled_from([(0.0, 0.0), (math.pi, 0.0), (0.0, math.pi)]), st.floats(-1, 1), st.floats(-1, 1)
)
def test_mounts_upright_and_upside_down_place_points_as_their_rotation_does(
    yaw: float, tilt: tuple[float, float], x: float, y: float
) -> None:
    roll, pitch = tilt
    transform = mount((0.2, -0.1), roll=roll, pitch=pitch, yaw=yaw)
    cy, sy = math.cos(yaw), math.sin(yaw)
    Rz = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    tilted = np.diag([math.cos(pitch), math.cos(roll), math.cos(roll) * math.cos(pitch)])
    expected = (Rz @ tilted @ np.array([x, y, 0.0]))[:2] + np.array([0.2, -0.1])
    sensor = Mount.of(transform)
    assert sensor.upside_down == (tilt != (0.0, 0.0))
    np.testing.assert_allclose(to_base(np.array([[x, y]]), sensor, None)[0], expected, atol=1e-9)


def intake_of(config: LidarConfig) -> ScanIntake:
    odometry = OdometryConfig()
    return ScanIntake(config, odometry, TimeBase(odometry.clock))


def test_a_laser_that_hangs_upside_down_sees_the_left_on_the_left() -> None:
    intake = intake_of(LidarConfig())
    list(intake.mounts.learn(StaticTransforms(0, (mount((0.5, 0.0), roll=math.pi),))))
    points = intake.led(scan([2.0], angle_min=-math.pi / 2), np.zeros(3))[0]
    np.testing.assert_allclose(points, [[0.5, 2.0]], atol=1e-6)
    assert intake.mounts.knows("laser")
    assert not intake.mounts.knows("another")


def test_a_mount_of_the_configuration_goes_before_tf_static() -> None:
    intake = intake_of(LidarConfig(mount=[0.1, 0.2, math.pi / 2]))
    list(intake.mounts.learn(StaticTransforms(0, (mount((5.0, 5.0)),))))
    np.testing.assert_allclose(intake.led(scan([1.0]), np.zeros(3))[0], [[0.1, 1.2]], atol=1e-6)


def test_a_mount_that_is_not_finite_or_not_on_the_base_is_passed_over() -> None:
    intake = intake_of(LidarConfig())
    nan = Transform("base_link", "laser", (math.nan, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    elsewhere = Transform("map", "laser", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    list(intake.mounts.learn(StaticTransforms(0, (nan, elsewhere))))
    assert not intake.mounts.knows("laser")
    np.testing.assert_allclose(intake.led(scan([1.0]), np.zeros(3))[0], [[1.0, 0.0]], atol=1e-6)


# Normals and thinning


def test_the_normals_of_a_room_are_those_of_its_walls_and_look_at_the_sensor() -> None:
    rng = np.random.default_rng(0)
    heading = 0.3
    seen = see(box(-3.0, -2.0, 4.0, 3.0), Pose2(0.0, 0.0, heading), rng, sigma_m=0.002)
    known = ~np.isnan(seen.normals[:, 0])
    assert known.mean() > 0.9
    points = Pose2(0.0, 0.0, heading).transform(seen.points[known])
    normals = Pose2(0.0, 0.0, heading).transform(seen.normals[known])
    distance = np.stack([points[:, 0] + 3, 4 - points[:, 0], points[:, 1] + 2, 3 - points[:, 1]])
    wall, corner = np.argmin(np.abs(distance), axis=0), np.sort(np.abs(distance), axis=0)[1] < 0.3
    inwards = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])[wall]
    cosine = (normals * inwards).sum(axis=1)[~corner]
    assert cosine.min() > math.cos(math.radians(8.0))
    assert np.median(cosine) > math.cos(math.radians(2.0))
    np.testing.assert_allclose(np.hypot(*normals.T), 1.0, atol=1e-9)


def test_where_no_line_fits_there_is_no_normal() -> None:
    alone = np.array([[1.0, 0.0], [0.0, 5.0], [-7.0, 0.0]])
    assert np.isnan(fit_normals(alone, np.zeros(2), LidarConfig())[1]).all()
    blob = np.random.default_rng(1).normal([3.0, 0.0], 0.03, (40, 2))
    assert np.isnan(fit_normals(blob, np.zeros(2), LidarConfig())[1]).all(axis=1).mean() > 0.5
    assert fit_normals(np.empty((0, 2)), np.zeros(2), LidarConfig())[1].shape == (0, 2)


def test_far_walls_have_normals_though_their_beams_are_wide_apart() -> None:
    wall = np.stack([np.full(20, 20.0), np.arange(20) * 0.35], axis=1)
    normals = fit_normals(wall, np.zeros(2), LidarConfig())[1][1:-1]
    np.testing.assert_allclose(np.abs(normals), [[1.0, 0.0]] * 18, atol=1e-9)


def walls_of_a_corridor(rng: np.random.Generator, sigma_m: float) -> Floats:
    """(n, 2) noisy points in beam order on two walls, 1.2 m to the right and the left of the sensor, up to 8 m away."""
    bearings = np.concatenate([np.arange(-2.35, -0.15, 0.00436), np.arange(0.15, 2.35, 0.00436)])
    ranges = 1.2 / np.abs(np.sin(bearings)) + sigma_m * rng.standard_normal(len(bearings))
    return ranges[:, None] * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)


@settings(deadline=None)
@given(st.integers(0, 2**31), st.floats(0.05, 0.3))
def test_thinned_points_stand_as_far_apart_along_a_wall_as_asked(seed: int, spacing_m: float) -> None:
    points = walls_of_a_corridor(np.random.default_rng(seed), 0.005)
    normals = np.tile([0.0, -1.0], (len(points), 1))
    kept = thin(points, normals, np.zeros(2), spacing_m)
    assert kept[0] == 0
    near = kept[np.abs(points[kept, 0]) < 1.0]
    along = np.abs(np.diff(points[near, 0]))
    assert np.median(along) == pytest.approx(spacing_m, abs=0.02)


def test_thinning_does_not_choose_points_by_their_noise() -> None:
    off = []
    for seed in range(100):
        points = walls_of_a_corridor(np.random.default_rng(seed), 0.02)
        normals = np.tile([0.0, -1.0], (len(points), 1))
        off.append(np.abs(points[thin(points, normals, np.zeros(2), 0.08), 1]) - 1.2)
    off_m = np.concatenate(off)
    assert abs(off_m.mean()) < 4 * off_m.std() / math.sqrt(len(off_m))


def test_points_of_a_wall_are_moved_onto_it() -> None:
    points = walls_of_a_corridor(np.random.default_rng(3), 0.003)
    placed, normals = fit_normals(points, np.zeros(2), LidarConfig())
    seen = np.isfinite(normals[:, 0]) & (np.abs(points[:, 0]) < 2.0)
    noise = (np.abs(points[seen, 1]) - 1.2).std()
    assert (np.abs(placed[seen, 1]) - 1.2).std() < 0.7 * noise


# Motion during a sweep


def moving(speed_m_s: float, turn_rad_s: float) -> DrivenPath:
    """A robot that drives and turns steadily from t = 0 s to 3 s, 100 Hz."""
    path = DrivenPath(OdometryConfig())
    for k in range(301):
        t = k / 100
        theta = turn_rad_s * t
        if turn_rad_s:
            x, y = speed_m_s / turn_rad_s * math.sin(theta), speed_m_s / turn_rad_s * (1 - math.cos(theta))
        else:
            x, y = speed_m_s * t, 0.0
        path.advance(k * S // 100, Pose2(x, y, theta))
    return path


@pytest.mark.parametrize(("speed", "turn"), [(0.0, 0.0), (1.0, 0.0), (0.0, 0.4), (0.5, 0.3)])
def test_a_sweep_taken_on_the_way_gives_the_points_of_its_first_moment(speed: float, turn: float) -> None:
    """A wall at x = 5 m of the path, seen beam by beam for half a second from a robot that moves."""
    path, beams, increment = moving(speed, turn), 60, 0.01
    each_s = 0.5 / beams
    T_path_start = path.at(S)
    assert T_path_start is not None
    ranges, expected = [], []
    for i in range(beams):
        point = path.at(S + int(i * each_s * S))
        assert point is not None
        bearing = -0.3 + i * increment
        T = point.T_path_base
        r = (5.0 - T.x) / math.cos(T.theta + bearing)
        ranges.append(r)
        hit = T.transform(np.array([[r * math.cos(bearing), r * math.sin(bearing)]]))
        expected.append(T_path_start.T_path_base.inverse().transform(hit)[0])
    intake = intake_of(LidarConfig())
    intake.queue.add(S, scan(ranges, -0.3, increment, each_s))
    (found,) = intake.ready(path)
    assert isinstance(found, SweepSet)
    placed = intake.place(found, path)
    assert placed is not None
    np.testing.assert_allclose(placed.hits, expected, atol=0.01)
