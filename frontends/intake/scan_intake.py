"""Laser scans on their way to a keyframe: they wait for the odometry that tells where they were taken."""

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import DropReason
from wayfi.frontends.intake.cloud_intake import CloudIntake, cloud_duration_ns, has_return
from wayfi.frontends.lidar.laser_points import beam_points, scan_from_points, to_base, valid_beams
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.mount import Mount
from wayfi.frontends.measurements import LaserScan, PointCloud, Sensor, StaticTransform, StaticTransforms, Sweep
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.scan_points import ScanPoints

GAP_NS = 1_000_000_000
MOST_FRAMES = 100  # whose mounts are kept
MOST_WAITING, MOST_POINTS_WAITING = 200, 20_000_000  # scans: 5 s at 40 Hz; of what they hold: some 300 MB
FURTHEST_MOUNT_M = 100.0
SMALLEST_NORM, LARGEST_NORM = 1e-3, 1e3  # of a quaternion


@dataclass(frozen=True, slots=True, eq=False)
class PlacedScan:
    """A scan at its place on the path: thinned `points` with normals, and all `hits` (n, 2) float32 m in base_link.

    `band` (m, 3) m holds the height band's points of the cloud that the scan was cut from, if it was.
    """

    point: PathPoint
    points: ScanPoints
    hits: NDArray[np.float32]
    band: Floats | None = None


class ScanIntake:
    """Knows where the laser is mounted and which scans still wait."""

    def __init__(self, config: LidarConfig, base_frame: str = "base_link") -> None:
        self._config = config
        self._base_frame = base_frame
        self._mounts: dict[str, Mount] = {}
        self.clouds = CloudIntake(config, self._mounts)
        self._waiting: deque[tuple[int, Sweep]] = deque()
        self._points_waiting = 0

    def take_transforms(self, transforms: StaticTransforms) -> list[DropReason]:
        """Learn where sensors are mounted on the base; returns why a mount is not taken, for each that is not."""
        refused = []
        for t in transforms.transforms:
            if t.frame_id != self._base_frame:
                continue
            reason = self._refuses(t)
            if reason:
                refused.append(reason)
            else:
                self._mounts[t.child_frame_id] = Mount.of(t)
        return refused

    def _refuses(self, t: StaticTransform) -> DropReason | None:
        away_m, norm = math.hypot(*t.translation_xyz), math.hypot(*t.rotation_xyzw)
        if not (math.isfinite(away_m) and math.isfinite(norm)):
            return DropReason.NON_FINITE
        if away_m > FURTHEST_MOUNT_M or not SMALLEST_NORM <= norm <= LARGEST_NORM:
            return DropReason.ABSURD_MOUNT
        full = len(self._mounts) >= MOST_FRAMES and t.child_frame_id not in self._mounts
        return DropReason.TOO_MANY_FRAMES if full else None

    def knows(self, frame_id: str) -> bool:
        """Whether the mount of a frame is known, from /tf_static or the configuration."""
        return bool(self._config.mount) or frame_id in self._mounts or frame_id == self._base_frame

    def wait(self, stamp_ns: int, scan: Sweep) -> list[Sweep]:
        """Queue a scan until the odometry has come so far; returns those that make room for it, unused."""
        self._waiting.append((stamp_ns, scan))
        self._points_waiting += size(scan)
        dropped = []
        while len(self._waiting) > MOST_WAITING or self._points_waiting > max(MOST_POINTS_WAITING, size(scan)):
            dropped.append(self._pop()[1])
        return dropped

    def waiting(self) -> list[tuple[int, Sweep]]:
        """The scans that wait, oldest first, each with its stamp on the time base."""
        return list(self._waiting)

    def drop_ahead(self, stamp_ns: int) -> list[Sweep]:
        """Forget the scans stamped after `stamp_ns`: their clock is not the odometry's."""
        ahead = [scan for scan_ns, scan in self._waiting if scan_ns > stamp_ns]
        self._waiting = deque(waiting for waiting in self._waiting if waiting[0] <= stamp_ns)
        self._points_waiting -= sum(map(size, ahead))
        return ahead

    @property
    def waited_ns(self) -> int:
        """From the oldest scan that waits to the newest; a gap between two of them counts for a second at most."""
        return sum(min(after[0] - before[0], GAP_NS) for before, after in pairwise(self._waiting))

    def ready(self, path: DrivenPath) -> list[tuple[PathPoint | None, Sweep]]:
        """The scans whose sweep the odometry covers now, each at its place; None where that is no longer kept."""
        out: list[tuple[PathPoint | None, Sweep]] = []
        latest = path.latest
        while latest and self._waiting and self._waiting[0][0] + sweep_ns(self._waiting[0][1]) <= latest.stamp_ns:
            stamp_ns, scan = self._pop()
            out.append((path.at(stamp_ns), scan))
        return out

    def points(self, scan: LaserScan) -> Floats:
        """(n, 2) points of a scan in base_link, m, as of one instant."""
        return to_base(beam_points(scan, self._config.max_range_m)[1], self._mount(scan.frame_id), None)

    def place(self, point: PathPoint, scan: Sweep, path: DrivenPath) -> PlacedScan | None:
        """The scan's points in base_link at `point`; None if no beam returned."""
        if isinstance(scan, PointCloud):
            cut = self.clouds.place(point, scan, path)
            return PlacedScan(point, cut.scan, cut.hits, cut.band) if cut else None
        beams, points = beam_points(scan, self._config.max_range_m)
        if len(points) == 0:
            return None
        mount = self._mount(scan.frame_id)
        points = to_base(points, mount, _sweep_motion(point, scan, beams, path))
        return PlacedScan(point, scan_from_points(points, mount.planar, self._config), points.astype(np.float32))

    def _pop(self) -> tuple[int, Sweep]:
        stamp_ns, scan = self._waiting.popleft()
        self._points_waiting -= size(scan)
        return stamp_ns, scan

    def _mount(self, frame_id: str) -> Mount:
        if self._config.mount:
            return Mount.level(Pose2.of(self._config.mount))
        return self._mounts.get(frame_id) or Mount.level(Pose2())


def size(scan: Sweep) -> int:
    """How many beams or points a scan holds."""
    return len(scan.points if isinstance(scan, PointCloud) else scan.ranges)


def sensor_of(scan: Sweep) -> Sensor:
    """The sensor that a scan is from."""
    return Sensor.POINTS if isinstance(scan, PointCloud) else Sensor.SCAN


def sees_anything(scan: Sweep, max_range_m: float) -> bool:
    """Whether a scan holds a return within `max_range_m`, a cloud one at all."""
    return has_return(scan) if isinstance(scan, PointCloud) else len(valid_beams(scan, max_range_m)) > 0


def sweep_ns(scan: Sweep) -> int:
    """How long after its stamp the last beam of a scan was taken, ns; 0 where the message does not say."""
    if isinstance(scan, PointCloud):
        return cloud_duration_ns(scan)
    seconds = scan.time_increment_s * len(scan.ranges)
    return int(seconds * 1e9) if 0 < seconds < 2.0 else 0


def _sweep_motion(point: PathPoint, scan: LaserScan, beams: NDArray[np.int64], path: DrivenPath) -> Floats | None:
    """(n, 3) motion of the base from the scan's stamp to each beam; None for a sweep that takes no time."""
    duration = sweep_ns(scan)
    end = path.at(point.stamp_ns + duration)
    if duration == 0 or end is None:
        return None
    motion = point.T_path_base.between(end.T_path_base).array()
    if not math.isfinite(float(motion.sum())):
        return None
    share: Floats = beams / max(len(scan.ranges), 1)
    return share[:, None] * motion
