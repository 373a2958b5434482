"""Odometry from the laser, planar or 3D, for a robot that sends no wheel odometry."""

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.cloud.cloud_odometry import CloudLead
from wayfi.frontends.intake.scan_intake import ScanIntake
from wayfi.frontends.lidar.laser_odometry import LaserOdometry
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.measurements import NANOSECOND_S, PAUSE_NS, PointCloud, Sweep


class LaserLead:
    """Matches the sweeps of one laser in their order; the frame of its poses drifts.

    `second` is the motion of the last second before, if it is known: a planar laser's first step is looked for there.
    """

    def __init__(self, config: LidarConfig, scans: ScanIntake, second: Pose2 | None) -> None:
        self._scans = scans
        self._planar = LaserOdometry(config)
        self._spatial = CloudLead(config)
        self._second = second
        self._first_ns: int | None = None
        self._followed: tuple[str, int] | None = None  # the laser's stream, and the stamp of its newest sweep

    def follows(self, stamp_ns: int, sweep: Sweep) -> bool:
        """Whether a sweep is from the laser that leads: the first, until it has been silent for a second."""
        laser = self._scans.laser_of(sweep).stream
        if self._followed and laser != self._followed[0] and stamp_ns - self._followed[1] <= PAUSE_NS:
            return False
        self._followed = laser, stamp_ns
        return True

    def match(self, stamp_ns: int, sweep: Sweep) -> Pose2:
        """Match the next sweep; returns T_odom_base at `stamp_ns`, the sweep's."""
        if isinstance(sweep, PointCloud):
            return self._spatial.match(stamp_ns, *self._scans.clouds.band(sweep))
        if self._first_ns is None:
            self._first_ns = stamp_ns
        elif self._second is not None:
            self._planar.expect(Pose2().interpolate(self._second, (stamp_ns - self._first_ns) * NANOSECOND_S))
            self._second = None
        return self._planar.match(self._scans.points(sweep))
