"""Odometry from the laser, planar or 3D, for a robot that sends no wheel odometry."""

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.cloud.cloud_odometry import CloudLead
from wayfi.frontends.intake.scan_intake import ScanIntake
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.scan_odometry import Led, ScanOdometry
from wayfi.frontends.measurements import NANOSECOND_S, PAUSE_NS, PointCloud, Sweep


class LaserLead:
    """Matches the sweeps of one laser in their order; the frame of its poses drifts.

    `last_ns` is where the path ends, and `second` the motion of the last second before, if they are known: a planar
    laser's first step is looked for there.
    """

    def __init__(
        self, config: LidarConfig, scans: ScanIntake, last_ns: int | None = None, second: Pose2 | None = None
    ) -> None:
        self._scans = scans
        self._longest_gap_s = config.lead.longest_gap_s
        self._last_ns = last_ns
        self._planar = ScanOdometry(config, second.array() if second else None)
        self._spatial = CloudLead(config)
        self._followed: tuple[str, int] | None = None  # the laser's stream, and the stamp of its newest sweep

    def follows(self, stamp_ns: int, sweep: Sweep) -> bool:
        """Whether a sweep is from the laser that leads: the first, until it has been silent for a second."""
        laser = self._scans.laser_of(sweep).stream
        if self._followed and laser != self._followed[0] and stamp_ns - self._followed[1] <= PAUSE_NS:
            return False
        self._followed = laser, stamp_ns
        return True

    def match(self, stamp_ns: int, sweep: Sweep) -> Led:
        """Match the next sweep; its pose is that at `stamp_ns`, the sweep's."""
        seconds = (stamp_ns - self._last_ns) * NANOSECOND_S if self._last_ns is not None else 0.0
        self._last_ns = stamp_ns
        if isinstance(sweep, PointCloud):
            led = Led(self._spatial.match(stamp_ns, *self._scans.clouds.band(sweep)))
        else:
            led = self._planar.match(stamp_ns, *self._scans.led(sweep, self._planar.velocity))
        return led._replace(step=led.step._replace(blind=seconds > self._longest_gap_s))
