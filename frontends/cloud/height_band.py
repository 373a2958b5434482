"""From a 3D cloud to what a robot on level ground can match: the points of a height band, and a planar scan of them.

Floor and ceiling are left out: they constrain neither x nor y nor theta, and the rings that a spinning LiDAR draws on
them move with the robot, so that point-to-point matching finds a robot that stands still.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.lidar_config import CloudConfig
from wayfi.frontends.lidar.mount import Mount
from wayfi.frontends.measurements import PointCloud


def band_points(cloud: PointCloud, mount: Mount, max_range_m: float, config: CloudConfig) -> tuple[Floats, Floats]:
    """The band's points (n, 3) m, each in base_link when it was taken, and their times (n,) s after the stamp.

    Heights are above base_link. Rows that are not finite, on the robot itself or beyond `max_range_m` are left out.
    """
    time_s = np.zeros(len(cloud.points), np.float32) if cloud.time_s is None else cloud.time_s
    limits = (config.body_m, max_range_m, config.low_m, config.high_m)
    return _in_band(cloud.points, time_s, mount.rotation, mount.translation, *limits)


@njit(cache=True)
def _in_band(
    points: NDArray[np.float32], time_s: NDArray[np.float32], rotation: Floats, translation: Floats,
    body_m: float, max_range_m: float, low_m: float, high_m: float,
) -> tuple[Floats, Floats]:  # fmt: skip
    kept, times = np.empty((len(points), 3)), np.empty(len(points))
    count = 0
    for i in range(len(points)):
        x, y, z = points[i]
        square = x * x + y * y + z * z
        if not body_m**2 < square < max_range_m**2:
            continue
        height = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + translation[2]
        if not low_m < height < high_m:
            continue
        kept[count, 0] = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + translation[0]
        kept[count, 1] = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + translation[1]
        kept[count, 2] = height
        times[count] = time_s[i]
        count += 1
    return kept[:count].copy(), times[:count].copy()


def deskew(points: Floats, time_s: Floats, moments_s: Floats, motion: Floats) -> Floats:
    """Points (n, 3) m, each in base_link at its time (n,) s after the stamp, in base_link at the stamp.

    `motion` (m, 3) is T_base(stamp)_base(moment) at `moments_s` (m,) s after the stamp, ascending; interpolated.
    """
    x, y, theta = (np.interp(time_s, moments_s, motion[:, k]) for k in range(3))
    c, s = np.cos(theta), np.sin(theta)
    return np.stack(
        [c * points[:, 0] - s * points[:, 1] + x, s * points[:, 0] + c * points[:, 1] + y, points[:, 2]], axis=1
    )


def planar_scan(points: Floats, T_base_sensor: Pose2, bearings: int) -> Floats:
    """(m, 2) points m, in the order of their bearings, that a planar laser would see of a band's points (n, 3).

    In each of `bearings` sectors the nearest point is kept, whatever its height, as ROS's pointcloud_to_laserscan does.
    """
    return points[nearest_by_bearing(points, np.array([T_base_sensor.x, T_base_sensor.y]), bearings), :2]


@njit(cache=True)
def nearest_by_bearing(points: Floats, origin: Floats, bearings: int) -> NDArray[np.int64]:
    """Indices of the point nearest to `origin` (2,) in each of `bearings` equal sectors, counter-clockwise from -pi."""
    best, distance = np.full(bearings, -1), np.full(bearings, np.inf)
    for i in range(len(points)):
        dx, dy = points[i, 0] - origin[0], points[i, 1] - origin[1]
        sector = int((math.atan2(dy, dx) + math.pi) / (2 * math.pi) * bearings) % bearings
        if dx * dx + dy * dy < distance[sector]:
            best[sector], distance[sector] = i, dx * dx + dy * dy
    return best[best >= 0]
