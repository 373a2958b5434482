"""Scan matching from keyframe to keyframe, and how far the wheels are to be trusted beside it."""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.keyframes import Keyframes
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.scan_matching import ScanMatch, match_scan, merge_submap
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.wheel_noise import wheel_covariance
from wayfi.frontends.scan_points import ScanPoints


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """A keyframe's scan match in the frame of the one before, and the submap it was matched to, (n, 2) m there."""

    match: ScanMatch
    submap: Floats


class ScanTracker:
    """Matches each keyframe's scan to a submap of the ones before it.

    `covariance_scale` (>= 1) is by how much the wheels' covariance must grow to agree with the laser.
    """

    def __init__(self, keyframes: Keyframes, lidar: LidarConfig, odometry: OdometryConfig) -> None:
        self._keyframes = keyframes
        self._lidar, self._odometry, self._trust = lidar, odometry, lidar.trust
        self.covariance_scale = 1.0
        self._matched = False

    def wheel_covariance(self, motion: WheelMotion) -> Floats:
        """(3, 3) covariance of a wheel motion, as the laser has found the wheels to be."""
        return wheel_covariance(motion, self._odometry, self.covariance_scale)

    def match(self, scan: ScanPoints, motion: WheelMotion, guess: Pose2, poses: Floats) -> Tracked | None:
        """Match the scan of the keyframe `guess` away from the last of `poses` (n, 3); None without a submap."""
        if not self._matched:
            self._matched, self.covariance_scale = True, self._trust.initial
        n = len(poses)
        scans, placed, _ = self._keyframes.scans_around(n - self._lidar.submap_keyframes, n, poses[-1], poses)
        submap = merge_submap(scans, placed, self._lidar.cell_m)
        if submap is None or len(scan.points) < self._lidar.min_points:
            return None
        search_below = 1.1 if self.covariance_scale > self._trust.search_above else self._lidar.search_below
        match = match_scan(scan, submap, guess, self.wheel_covariance(motion), search_below, self._lidar)
        if match.inlier_ratio >= self._lidar.min_inlier_ratio:
            self.learn(motion, guess, match)
        return Tracked(match, submap.points)

    def learn(self, motion: WheelMotion, guess: Pose2, match: ScanMatch) -> None:
        """Take in how far a match of the keyframe is from what the wheels had guessed."""
        T = match.T_submap_scan
        e = np.array([T.x - guess.x, T.y - guess.y, wrap(T.theta - guess.theta)])
        expected = wheel_covariance(motion, self._odometry) + match.covariance
        seen = min(float(e @ np.linalg.solve(expected, e)) / 3, self._trust.most)
        self.covariance_scale = max(1.0, self._trust.memory * self.covariance_scale + (1 - self._trust.memory) * seen)
