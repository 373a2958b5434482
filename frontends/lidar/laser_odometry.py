"""Odometry from the laser alone, for a robot without wheel odometry: KISS-ICP in the plane.

Vizzo et al., "KISS-ICP: In Defense of Point-to-Point ICP" (RA-L 2023); the points lie at z = 0.
"""

import numpy as np
from kiss_icp.config.parser import load_config
from kiss_icp.kiss_icp import KissICP

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.lidar_config import LidarConfig


class LaserOdometry:
    """Registers scans in their order; the frame of its poses drifts."""

    def __init__(self, config: LidarConfig) -> None:
        kiss = load_config(None)
        kiss.data.max_range = config.max_range_m
        kiss.data.min_range = 0.0
        kiss.data.deskew = False
        kiss.mapping.voxel_size = config.lead_voxel_m
        kiss.registration.max_num_threads = 1
        self._kiss = KissICP(config=kiss)

    def register(self, points: Floats) -> Pose2:
        """T_odom_base after a scan of (n, 2) `points` in base_link, m."""
        spatial = np.column_stack([points, np.zeros(len(points))])
        self._kiss.register_frame(spatial, np.zeros(len(points)))
        return Pose2.in_plane(self._kiss.last_pose)
