"""Point clouds on their way to a keyframe: the mount in space, the sweep's motion undone, the scan cut from a cloud."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, between_all
from wayfi.frontends.cloud.height_band import Mount, band_points, cut, level_mount, spatial_mount, undo_motion
from wayfi.frontends.lidar.laser_points import walls_seen
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.measurements import PointCloud, StaticTransform
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.scan_points import ScanPoints

MOMENTS = 11  # of a sweep at which the wheels are asked where the base was


@dataclass(frozen=True, slots=True, eq=False)
class CutCloud:
    """A cloud in base_link, m: the `scan` cut from it, all `hits` (m, 2) float32 of that, and the `band` (n, 3)."""

    scan: ScanPoints
    hits: NDArray[np.float32]
    band: Floats


class CloudIntake:
    """Knows where 3D LiDARs are mounted."""

    def __init__(self, config: LidarConfig) -> None:
        self._config = config
        self._mounts: dict[str, Mount] = {}

    def add_mount(self, transform: StaticTransform) -> None:
        """Learn where a sensor is mounted on the base."""
        if math.hypot(*transform.rotation_xyzw) > 0.0:
            self._mounts[transform.child_frame_id] = spatial_mount(transform)

    def band(self, cloud: PointCloud) -> tuple[Floats, Floats]:
        """(n, 3) points of a cloud's height band in base_link, m, and their times (n,) after its stamp, s."""
        return band_points(cloud, self._mount(cloud.frame_id), self._config.max_range_m, self._config.cloud)

    def cut(self, point: PathPoint, cloud: PointCloud, path: DrivenPath) -> CutCloud | None:
        """The scan of a cloud whose stamp is at `point`; None if nothing returned from its height band."""
        band, time_s = self.band(cloud)
        if len(band) == 0:
            return None
        moments_s = np.linspace(time_s.min(), time_s.max(), MOMENTS)
        motion = _motion(point, moments_s, path)
        if motion is not None:
            band = undo_motion(band, time_s, moments_s, motion)
        sensor = self._mount(cloud.frame_id).planar
        lidar = self._config
        hits = cut(band, sensor, lidar.cloud)
        scan = walls_seen(hits, sensor, lidar.normal_radius_m, lidar.thinning_m)
        return CutCloud(scan, hits.astype(np.float32), band)

    def _mount(self, frame_id: str) -> Mount:
        if self._config.mount:
            return level_mount(Pose2.of(self._config.mount), self._config.cloud)
        return self._mounts.get(frame_id) or level_mount(Pose2(), self._config.cloud)


def turn_ns(cloud: PointCloud) -> int:
    """How long after its stamp the last point of a cloud was taken, ns; 0 where the message does not say."""
    if cloud.time_s is None or len(cloud.time_s) == 0:
        return 0
    return max(int(float(cloud.time_s.max()) * 1e9), 0)


def any_return(cloud: PointCloud) -> bool:
    """Whether a cloud holds a point at all."""
    return bool(np.isfinite(cloud.points).all(axis=1).any())


def _motion(point: PathPoint, moments_s: Floats, path: DrivenPath) -> Floats | None:
    """(m, 3) T_base(point)_base(moment) by the wheels; None where they are not kept, or where no time passes."""
    if moments_s[0] == moments_s[-1]:
        return None
    places = [path.at(point.stamp_ns + round(s * 1e9)) for s in moments_s.tolist()]
    poses = [place.T_path_base.array() for place in places if place is not None]
    return between_all(point.T_path_base.array(), np.array(poses)) if len(poses) == len(places) else None
