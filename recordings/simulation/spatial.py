"""A simulated run of a robot with a 3D LiDAR instead of the planar one."""

import heapq
from collections.abc import Iterator

from wayfi.backend.pose2 import Pose2, compose_all
from wayfi.frontends.measurements import SECOND_NS, Measurement, PointCloud
from wayfi.recordings.simulation import lidar3d
from wayfi.recordings.simulation.run import EPOCH_NS, Run, mount, odometry, stream, wifi_scans

PERIOD_NS, DELAY_NS = 100_000_000, 30_000_000
FRAME = "lidar"
T_BASE_LIDAR = Pose2(0.1, 0.0, 0.0)


def spatial_measurements(run: Run) -> Iterator[Measurement]:
    """All measurements in `run`, sorted by stamp, with point clouds instead of laser scans."""
    sensors: list[Iterator[Measurement]] = [
        mount(FRAME, T_BASE_LIDAR, lidar3d.HEIGHT_M),
        odometry(run),
        clouds(run),
        wifi_scans(run),
    ]
    return heapq.merge(*sensors, key=lambda measurement: measurement.stamp_ns)


def clouds(run: Run) -> Iterator[PointCloud]:
    """The point clouds of the LiDAR, one for each turn, with the stamp of its first column."""
    rng = stream(run.seed, "lidar3d")
    heights_m = lidar3d.heights(run.surfaces)
    for since_ns in range(DELAY_NS, run.length_ns + 1 - PERIOD_NS, PERIOD_NS):
        start_s = since_ns / SECOND_NS
        poses = compose_all(run.drive.poses(lidar3d.column_times(start_s)), T_BASE_LIDAR.array())
        points, time_s = lidar3d.sweep(run.surfaces, heights_m, poses, start_s, rng)
        yield PointCloud(EPOCH_NS + since_ns, FRAME, points, time_s)
