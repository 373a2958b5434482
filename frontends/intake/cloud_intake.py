"""Point clouds on their way to a keyframe: mounted in space, deskewed by the odometry, and a planar scan of them."""

import numpy as np

from wayfi.backend.pose2 import Floats, between_all
from wayfi.frontends.cloud.height_band import band_points, deskew, planar_scan
from wayfi.frontends.intake.mounts import Mounts
from wayfi.frontends.lidar.laser_points import scan_from_points
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.mount import Mount
from wayfi.frontends.measurements import SECOND_NS, PointCloud
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.scan_points import PlacedScan

MOMENTS = 11  # at which a sweep's motion is asked of the odometry: every 10 ms of a turn at 10 Hz, as fast as it comes


class CloudIntake:
    """Places clouds in base_link."""

    def __init__(self, config: LidarConfig, mounts: Mounts) -> None:
        self._config = config
        self._mounts = mounts

    def band(self, cloud: PointCloud) -> tuple[Floats, Floats]:
        """(n, 3) points of a cloud's height band in base_link, m, and their times (n,) after its stamp, s."""
        return band_points(cloud, self.mount(cloud.frame_id), self._config.max_range_m, self._config.cloud)

    def heights(self, cloud: PointCloud) -> Floats:
        """(n,) m above base_link of a cloud's points that are finite, off the robot itself and within the range."""
        mount, points = self.mount(cloud.frame_id), cloud.points[np.isfinite(cloud.points).all(axis=1)]
        away_m = np.linalg.norm(points.astype(np.float64), axis=1)
        near = (self._config.cloud.body_m < away_m) & (away_m < self._config.max_range_m)
        heights: Floats = points[near] @ mount.rotation[2] + mount.translation[2]
        return heights

    def place(self, point: PathPoint, cloud: PointCloud, path: DrivenPath) -> PlacedScan | None:
        """A cloud whose stamp is at `point`, deskewed; None if nothing returned from its height band."""
        band, time_s = self.band(cloud)
        if len(band) == 0:
            return None
        moments_s = np.linspace(time_s.min(), time_s.max(), MOMENTS)
        motion = _motion(point, moments_s, path)
        if motion is not None:
            band = deskew(band, time_s, moments_s, motion)
        T_base_sensor = self.mount(cloud.frame_id).planar
        hits = planar_scan(band, T_base_sensor, self._config.cloud.bearings)
        return PlacedScan(scan_from_points(hits, T_base_sensor, self._config), hits.astype(np.float32), band)

    def mount(self, frame_id: str) -> Mount:
        """The mount of a frame; one of unknown height is assumed in the middle of the band."""
        height_m = 0.5 * (self._config.cloud.low_m + self._config.cloud.high_m)
        return self._mounts.of(frame_id, height_m)


def cloud_duration_ns(cloud: PointCloud) -> int:
    """How long after its stamp the last point of a cloud was taken, ns; 0 where its points have no times."""
    if cloud.time_s is None or len(cloud.time_s) == 0:
        return 0
    return max(int(float(cloud.time_s.max()) * SECOND_NS), 0)


def has_return(cloud: PointCloud) -> bool:
    """Whether a cloud holds a finite point."""
    return bool(np.isfinite(cloud.points).all(axis=1).any())


def _motion(point: PathPoint, moments_s: Floats, path: DrivenPath) -> Floats | None:
    """(m, 3) T_base(point)_base(moment) by the odometry; None where it is not kept, or where no time passes."""
    if moments_s[0] == moments_s[-1]:
        return None
    places = [path.at(point.stamp_ns + round(s * SECOND_NS)) for s in moments_s.tolist()]
    poses = [place.T_path_base.array() for place in places if place is not None]
    return between_all(point.T_path_base.array(), np.array(poses)) if len(poses) == len(places) else None
