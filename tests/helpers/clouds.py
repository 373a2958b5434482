"""Places for a simulated 3D LiDAR, and what it makes of them."""

from collections.abc import Iterator

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.cloud.height_band import band_points
from wayfi.frontends.lidar.lidar_config import CloudConfig
from wayfi.frontends.lidar.mount import Mount
from wayfi.frontends.measurements import PointCloud
from wayfi.recordings.simulation import lidar3d
from wayfi.recordings.simulation.surfaces import Surfaces, box, still

MOUNT = Mount(np.eye(3), np.array([0.0, 0.0, lidar3d.HEIGHT_M]))
MAX_RANGE_M = 25.0
HALL = still(
    np.vstack(
        [
            box(-6.0, -4.0, 10.0, 7.0),
            *(box(x - 0.2, y - 0.2, x + 0.2, y + 0.2) for x in (-2.0, 3.0, 7.0) for y in (-2.0, 4.0)),
        ]
    )
)
CORRIDOR = still(np.array([[-200.0, 1.2, 200.0, 1.2], [-200.0, -1.2, 200.0, -1.2]]))


def cloud_at(surfaces: Surfaces, pose: Pose2, seed: int) -> PointCloud:
    """What the LiDAR of a robot that stands at `pose` sees."""
    poses = np.tile(pose.array(), (lidar3d.COLUMNS, 1))
    rng = np.random.default_rng(seed)
    return PointCloud(0, "lidar", *lidar3d.sweep(surfaces, lidar3d.heights(surfaces), poses, 0.0, rng))


def band_at(surfaces: Surfaces, pose: Pose2, seed: int) -> Floats:
    """The height band of that, in base_link."""
    return band_points(cloud_at(surfaces, pose, seed), MOUNT, MAX_RANGE_M, CloudConfig())[0]


def straight_way(steps: int, step: Pose2) -> Iterator[Pose2]:
    """Poses of a robot that makes the same step again and again."""
    pose = Pose2()
    for _ in range(steps):
        yield pose
        pose = pose @ step
