"""A recording for the batch method: each WiFi scan is a pose with a fingerprint and, if there is one, a laser scan."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, between_all
from wayfi.frontends.lidar.laser_points import beam_points, scan_from_points, to_base
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.mount import Mount
from wayfi.frontends.measurements import SECOND_NS, LaserScan, Measurement, Odometry, StaticTransforms, WifiScan
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.wifi.readings import Readings, usable_readings
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.trajectory import Stamps, Trajectory
from wayfi.service.reproduction.errors import ReproductionError
from wayfi.service.reproduction.messages import Progress, sensor_messages

SCAN_WITHIN_S = 2.0  # of the WiFi scan; the odometry gives the motion in between
LIDAR = LidarConfig(thinning_m=0.08)  # the paper's scans are of 600 points: about that many remain of a UST-20LX


@dataclass(frozen=True, slots=True, eq=False)
class RecordedDrive:
    """n WiFi scans, sorted by time; `stamps_ns` (n,) are the times at which they were heard.

    `poses` (n, 3) and `path_m` (n,) are the odometry's pose and path length at these times. `scans` are laser points in
    the frame of a pose, by its index; empty without a laser. `odometry` is the whole odometry.
    """

    odometry: Trajectory
    stamps_ns: Stamps
    poses: Floats
    path_m: Floats
    readings: list[Readings]
    scans: dict[int, ScanPoints]


@dataclass(frozen=True, slots=True)
class _Measurements:
    """The measurements of a recording; `mounts` are the lasers', by frame."""

    odometry: list[Odometry] = field(default_factory=list)
    wifi: list[WifiScan] = field(default_factory=list)
    laser: list[LaserScan] = field(default_factory=list)
    mounts: dict[str, Mount] = field(default_factory=dict)

    def add(self, measurement: Measurement) -> None:
        match measurement:
            case Odometry() if measurement.pose.is_finite():
                self.odometry.append(measurement)
            case WifiScan():
                self.wifi.append(measurement)
            case LaserScan():
                self.laser.append(measurement)
            case StaticTransforms():
                self.mounts.update({t.child_frame_id: Mount.of(t) for t in measurement.transforms})


def read_drive(recording_path: Path, progress: Progress) -> RecordedDrive:
    """The drive in a recording. Messages that cannot be decoded are skipped.

    Raises RecordingError, or ReproductionError without WiFi or odometry.
    """
    received = _Measurements()
    for sensor, encoding, data in sensor_messages(recording_path, progress):
        try:
            received.add(decode(data, sensor, encoding))
        except CodecError:
            continue
    if len(received.odometry) < 2:
        raise ReproductionError(f"{recording_path}: no odometry; the paper's method starts from it")
    path = _odometry_path(received.odometry)
    stamps_ns, readings = _fingerprints(received.wifi, path)
    if len(readings) < 2:
        raise ReproductionError(f"{recording_path}: no WiFi to close loops with; see `wayfi inspect`")
    poses = path.at(stamps_ns)
    path_m = np.interp(path.seconds(stamps_ns), path.seconds(path.stamps_ns), path.path_m())
    return RecordedDrive(path, stamps_ns, poses, path_m, readings, _scans(received, path, stamps_ns, poses))


def _odometry_path(odometry: list[Odometry]) -> Trajectory:
    """The poses sorted by time; the first of several with the same stamp."""
    stamps_ns, first = np.unique(np.array([m.stamp_ns for m in odometry], np.int64), return_index=True)
    return Trajectory(stamps_ns, np.array([odometry[i].pose.array() for i in first]))


def _fingerprints(wifi: list[WifiScan], path: Trajectory) -> tuple[Stamps, list[Readings]]:
    """The median time of the readings of each usable scan, and its readings, within the time of the odometry."""
    heard = []
    for scan in wifi:
        readings, _ = usable_readings(scan)
        if readings.bssids:
            heard.append((scan.stamp_ns - int(float(np.median(readings.age_s)) * SECOND_NS), readings))
    heard = [scan for scan in heard if path.stamps_ns[0] <= scan[0] <= path.stamps_ns[-1]]
    heard.sort(key=lambda scan: scan[0])
    return np.array([stamp_ns for stamp_ns, _ in heard], np.int64), [readings for _, readings in heard]


def _scans(received: _Measurements, path: Trajectory, stamps_ns: Stamps, poses: Floats) -> dict[int, ScanPoints]:
    """The laser scan of each pose, if each is the other's nearest in time; transformed by the odometry in between."""
    if not received.laser:
        return {}
    laser = sorted(received.laser, key=lambda scan: scan.stamp_ns)
    scan_ns = np.array([scan.stamp_ns for scan in laser], np.int64)
    nearest = _nearest(scan_ns, stamps_ns)
    mutual = _nearest(stamps_ns, scan_ns)[nearest] == np.arange(len(stamps_ns))
    soon = np.abs(scan_ns[nearest] - stamps_ns) <= SCAN_WITHIN_S * SECOND_NS
    T_pose_scan = between_all(poses, path.at(scan_ns[nearest]))
    scans = {}
    for number in np.flatnonzero(mutual & soon).tolist():
        scan = laser[nearest[number]]
        mount = received.mounts.get(scan.frame_id) or Mount.level(Pose2())
        placed = _scan_points(scan, Pose2.of(T_pose_scan[number]), mount)
        if len(placed.points):
            scans[number] = placed
    return scans


def _scan_points(scan: LaserScan, T_pose_scan: Pose2, mount: Mount) -> ScanPoints:
    points = T_pose_scan.transform(to_base(beam_points(scan, LIDAR.max_range_m)[1], mount, None))
    return scan_from_points(points, T_pose_scan @ mount.planar, LIDAR)


def _nearest(sorted_ns: Stamps, stamps_ns: Stamps) -> NDArray[np.int64]:
    """(n,) the index of the nearest of `sorted_ns` for each of `stamps_ns`."""
    after = np.minimum(np.searchsorted(sorted_ns, stamps_ns), len(sorted_ns) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(stamps_ns - sorted_ns[before] < sorted_ns[after] - stamps_ns, before, after)
