"""Odometry by laser, for a robot without wheel odometry."""

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.cloud.cloud_odometry import CloudLead
from wayfi.frontends.intake.scan_intake import ScanIntake
from wayfi.frontends.intake.scan_queue import Sweep
from wayfi.frontends.lidar.laser_odometry import LaserOdometry
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.measurements import PointCloud


class LaserLead:
    """Matches the sweeps of one laser, in order, to the pose of the base in `odom`, a frame that drifts."""

    def __init__(self, config: LidarConfig, scans: ScanIntake) -> None:
        self._scans = scans
        self._planar = LaserOdometry(config.max_range_m)
        self._spatial = CloudLead(config)

    def register(self, stamp_ns: int, sweep: Sweep) -> Pose2:
        """T_odom_base at `stamp_ns`, the stamp of the sweep."""
        if isinstance(sweep, PointCloud):
            return self._spatial.register(stamp_ns, *self._scans.clouds.band(sweep))
        return self._planar.register(self._scans.points(sweep))
