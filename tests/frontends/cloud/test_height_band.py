"""The height band of a cloud: what belongs to it, whatever the mount, and the scan cut from it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfi.backend.pose2 import Pose2, between_all, compose_all
from wayfi.frontends.cloud.height_band import band_points, deskew, planar_scan
from wayfi.frontends.lidar.lidar_config import CloudConfig
from wayfi.frontends.lidar.mount import Mount
from wayfi.frontends.measurements import PointCloud, Transform

CONFIG = CloudConfig()
MAX_RANGE_M = 25.0
ANGLES = st.floats(-math.pi, math.pi)


def cloud(points: list[list[float]]) -> PointCloud:
    return PointCloud(0, "lidar", np.array(points, np.float32))


def upright(z: float) -> Transform:
    return Transform("base_link", "lidar", (0.1, 0.0, z), (0.0, 0.0, 0.0, 1.0))


def test_the_band_has_walls_but_not_floor_ceiling_robot_nan_or_far() -> None:
    wall, floor, ceiling, robot, far = [5.0, 0, 0], [3.0, 0, -0.7], [3.0, 0, 2.1], [0.3, 0, 0], [30.0, 0, 0]
    nowhere, endless, zero = [math.nan] * 3, [math.inf, 0, 0], [0.0, 0, 0]
    seen = cloud([wall, floor, ceiling, robot, far, nowhere, endless, zero])
    points, time_s = band_points(seen, Mount.of(upright(0.7)), MAX_RANGE_M, CONFIG)
    np.testing.assert_allclose(points, [[5.1, 0.0, 0.7]], atol=1e-6)
    assert time_s.tolist() == [0.0]


def test_each_point_keeps_its_own_time() -> None:
    seen = PointCloud(0, "l", np.array([[5, 0, 0], [5, 0, -0.7], [6, 0, 0]], np.float32), np.float32([0.1, 0.2, 0.3]))
    _, time_s = band_points(seen, Mount.of(upright(0.7)), MAX_RANGE_M, CONFIG)
    np.testing.assert_allclose(time_s, [0.1, 0.3])


@given(roll=ANGLES, pitch=st.floats(-1.5, 1.5), yaw=ANGLES, length=st.floats(0.1, 10.0))
def test_a_mount_may_be_turned_any_way(roll: float, pitch: float, yaw: float, length: float) -> None:
    """However the LiDAR hangs, a wall in base_link comes back as it stands there."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    rotation = (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
    scaled = tuple(length * part for part in rotation)
    mount = Mount.of(Transform("base_link", "lidar", (0.2, -0.1, 1.2), scaled))  # type: ignore[arg-type]
    about = [
        np.array([[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]]),
        np.array([[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]]),
        np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]),
    ]
    wall = np.array([[4.0, y, z] for y in (-1.0, 2.0) for z in (0.3, 1.0, 1.7)])
    measured = (wall - [0.2, -0.1, 1.2]) @ (about[2] @ about[1] @ about[0])
    points, _ = band_points(cloud(measured.tolist()), mount, MAX_RANGE_M, CONFIG)
    np.testing.assert_allclose(points, wall, atol=1e-5)


@given(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3))
def test_motion_undone_puts_points_back(velocity: list[float]) -> None:
    """What a moving robot sees of standing points is, its motion undone, what it would see at once at the stamp."""
    still = np.array([[5.0, 1.0, 0.5], [-3.0, 2.0, 1.0], [0.5, -4.0, 1.5]])
    time_s = np.array([0.0, 0.05, 0.1])
    moments_s = np.linspace(0.0, 0.1, 11)
    base = time_s[:, None] * np.array(velocity)
    standing = np.column_stack([still[:, :2], np.zeros(3)])
    seen = np.column_stack([between_all(base, standing)[:, :2], still[:, 2]])
    back = deskew(seen, time_s, moments_s, moments_s[:, None] * np.array(velocity))
    np.testing.assert_allclose(back, still, atol=1e-9)
    assert compose_all(base, between_all(base, standing)) == pytest.approx(standing)


def test_the_cut_holds_the_nearest_of_each_bearing_in_their_order() -> None:
    bearings = np.radians([90.1, -90.1, 0.1, 0.1, 179.5])
    ranges = np.array([2.0, 3.0, 5.0, 4.0, 1.0])
    points = np.column_stack([1.0 + ranges * np.cos(bearings), ranges * np.sin(bearings), np.full(5, 0.5)])
    hits = planar_scan(points, Pose2(1.0, 0.0, 0.7), CONFIG.bearings)
    np.testing.assert_allclose(hits, points[[1, 3, 0, 4], :2])


def test_an_empty_band_is_an_empty_cut() -> None:
    assert planar_scan(np.empty((0, 3)), Pose2(), CONFIG.bearings).shape == (0, 2)
