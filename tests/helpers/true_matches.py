"""Scan matches where all poses are true: the submap's scans and the first guess are at the truth."""

import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2, between_all, wrap
from wayfi.frontends.intake.mounts import Mounts
from wayfi.frontends.lidar.laser_points import beam_points, scan_from_points, to_base
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.mount import Mount
from wayfi.frontends.lidar.scan_matching import match_scan, merge_submap
from wayfi.frontends.measurements import LaserScan, Sensor, StaticTransforms
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.wheel_noise import wheel_covariance
from wayfi.frontends.scan_points import ScanPoints
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import Encoding
from wayfi.recordings.simulation.run import Run, scans_at

LIDAR, WHEELS = LidarConfig(), OdometryConfig()
OPEN_M = 0.5  # sigma of a match, from which on it claims nothing in that direction
Poses = Callable[[Floats], Floats]  # true poses (n, 3) at seconds (n,)


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Errors (n, 3) of matches, along and across the robot's heading (m) and of heading (rad), and their `sigmas`."""

    values: Floats
    sigmas: Floats

    def mean(self) -> Floats:
        """(3,) mean errors where the match claims something."""
        return np.array([values[claimed].mean() for values, claimed in self._claimed()])

    def standard_errors(self) -> Floats:
        """(3,) standard errors of the means."""
        return np.array([values[claimed].std() / np.sqrt(claimed.sum()) for values, claimed in self._claimed()])

    def nees(self) -> Floats:
        """(3,) mean of the squared error over the claimed variance."""
        shares = (self.values / self.sigmas) ** 2
        return np.array([shares[self.sigmas[:, k] < OPEN_M, k].mean() for k in range(3)])

    def _claimed(self) -> Iterator[tuple[Floats, Floats]]:
        return ((self.values[:, k], self.sigmas[:, k] < OPEN_M) for k in range(3))


def joined(parts: list[Errors]) -> Errors:
    """The errors of several drives."""
    return Errors(np.concatenate([part.values for part in parts]), np.concatenate([part.sigmas for part in parts]))


def keyframe_seconds(poses: Floats, seconds: Floats) -> Floats:
    """(k,) the times at which `poses` (n, 3) at `seconds` (n,) have moved on by a keyframe."""
    step = np.hypot(*np.diff(poses[:, :2], axis=0).T) / WHEELS.keyframe_distance_m
    step += np.abs(np.diff(np.unwrap(poses[:, 2]))) / WHEELS.keyframe_turn_rad
    passed = np.floor(np.r_[0.0, step.cumsum()])
    return seconds[np.flatnonzero(np.diff(passed, prepend=-1.0) > 0)]


def placed_at_truth(scan: LaserScan, second: float, mount: Mount, poses: Poses) -> ScanPoints:
    """A scan in base_link at `second`, its motion undone by the true one."""
    beams, points = beam_points(scan, LIDAR.max_range_m)
    true = poses(second + np.r_[0.0, beams * scan.time_increment_s])
    motion = between_all(true[0], true[1:]) if scan.time_increment_s else None
    return scan_from_points(to_base(points, mount, motion), mount.planar, LIDAR)


def match_errors(scans: list[ScanPoints], poses: Floats) -> Errors:
    """The errors of matching each of `scans` (n) to a submap of those before it, all at their true `poses` (n, 3)."""
    errors = []
    for k in range(LIDAR.submap_keyframes, len(scans)):
        first = k - LIDAR.submap_keyframes
        submap = merge_submap(scans[first:k], between_all(poses[k - 1], poses[first:k]), LIDAR.cell_m)
        true = Pose2.of(poses[k - 1]).between(Pose2.of(poses[k]))
        if submap is None or len(scans[k].points) < LIDAR.min_points:
            continue
        covariance = wheel_covariance(WheelMotion(true, true.distance(Pose2()), 1.0), WHEELS)
        match = match_scan(scans[k], submap, true, covariance, 0.0, LIDAR, None)
        if match.inlier_ratio >= LIDAR.min_inlier_ratio:
            errors.append(_in_the_robots_axes(true, match.T_submap_scan, match.covariance))
    values, sigmas = zip(*errors, strict=True)
    return Errors(np.array(values), np.array(sigmas))


def _in_the_robots_axes(true: Pose2, matched: Pose2, covariance: Floats) -> tuple[Floats, Floats]:
    c, s = np.cos(true.theta), np.sin(true.theta)
    R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    off = np.array([matched.x - true.x, matched.y - true.y, wrap(matched.theta - true.theta)])
    return R @ off, np.sqrt(np.diag(R @ covariance @ R.T))


def own_world(run: Run, most: int) -> Errors:
    """The errors in a simulated run, over at most so many keyframes."""
    seconds = keyframe_seconds(run.truth.poses, run.truth.seconds(run.truth.stamps_ns))[:most]
    stamps = run.truth.stamps_ns[0] + np.round(seconds * 1e9).astype(np.int64)
    mount = Mount.level(run.T_base_laser)
    seen = zip(scans_at(run, stamps), seconds.tolist(), strict=True)
    scans = [placed_at_truth(scan, second, mount, run.drive.poses) for scan, second in seen]
    return match_errors(scans, run.drive.poses(seconds))


def other_world(tool: Path, world: str, folder: Path, minutes: float, seed: int, rough: bool = True) -> Errors:
    """The errors in a drive of the other simulator, `tool`, made in `folder`."""
    made = [sys.executable, tool, world, folder, "--no-log", "--scan-hz", "5", *(["--rough"] if rough else [])]
    subprocess.run([*made, "--minutes", str(minutes), "--seed", str(seed)], check=True, capture_output=True)
    return recorded(folder / "recording.mcap", folder / "truth.tum")


def recorded(recording: Path, truth: Path) -> Errors:
    """The errors in a recording with a planar laser, on its scans one keyframe apart."""
    trajectory, mounts = read_tum(truth), Mounts(LIDAR)

    def poses(seconds: Floats) -> Floats:
        return trajectory.at(trajectory.stamps_ns[0] + np.round(seconds * 1e9).astype(np.int64))

    due = iter(keyframe_seconds(trajectory.poses, trajectory.seconds(trajectory.stamps_ns)).tolist())
    next_s, scans, seconds = next(due), [], []
    for measurement in _laser_and_mount(recording):
        if isinstance(measurement, StaticTransforms):
            for transform in measurement.transforms:
                mounts.add(transform)
            continue
        second = (measurement.stamp_ns - int(trajectory.stamps_ns[0])) * 1e-9
        if next_s is not None and second >= next_s:
            scans.append(placed_at_truth(measurement, second, mounts.of(measurement.frame_id), poses))
            seconds.append(second)
            while next_s is not None and next_s <= second:
                next_s = next(due, None)
    return match_errors(scans, poses(np.array(seconds)))


def _laser_and_mount(recording: Path) -> Iterable[LaserScan | StaticTransforms]:
    sensors = {DEFAULT_TOPICS[sensor]: sensor for sensor in (Sensor.SCAN, Sensor.TF_STATIC)}
    for message in open_recording(recording):
        if message.topic in sensors:
            measurement = decode(message.data, sensors[message.topic], Encoding(message.encoding))
            assert isinstance(measurement, LaserScan | StaticTransforms)
            yield measurement
