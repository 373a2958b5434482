"""Scan matching from keyframe to keyframe, and the scale of the wheels' covariance that agrees with it."""

import math
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
class KeyframeMatch:
    """A keyframe's scan match in the frame of the keyframe before, and the `submap` (n, 2) m of the match there."""

    match: ScanMatch
    submap: Floats


class ScanTracker:
    """Matches each keyframe's scan to a submap of the ones before it.

    `covariance_scale` (>= 1) multiplies the wheels' covariance, so that they agree with the laser.
    """

    def __init__(self, keyframes: Keyframes, lidar: LidarConfig, odometry: OdometryConfig) -> None:
        self._keyframes = keyframes
        self._lidar, self._odometry, self._trust = lidar, odometry, lidar.trust
        self.covariance_scale = 1.0
        self._matched = False

    def wheel_covariance(self, motion: WheelMotion) -> Floats:
        """(3, 3) covariance of a wheel motion, scaled."""
        return wheel_covariance(motion, self._odometry, self.covariance_scale)

    def match(self, scan: ScanPoints, motion: WheelMotion, guess: Pose2, poses: Floats) -> KeyframeMatch | None:
        """Match the scan of the keyframe `guess` away from the last of `poses` (n, 3); None without a submap."""
        if not self._matched:
            self._matched, self.covariance_scale = True, self._trust.initial
        n = len(poses)
        scans, placed = self._keyframes.scans_around(n - self._lidar.submap_keyframes, n, poses[-1], poses)
        submap = merge_submap(scans, placed, self._lidar.cell_m)
        if submap is None or len(scan.points) < self._lidar.min_points:
            return None
        search_below = math.inf if self.covariance_scale > self._trust.search_above else self._lidar.search_below
        match = match_scan(scan, submap, guess, self.wheel_covariance(motion), search_below, self._lidar)
        if match.inlier_ratio >= self._lidar.min_inlier_ratio:
            self.update_scale(motion, guess, match)
        return KeyframeMatch(match, submap.points)

    def update_scale(self, motion: WheelMotion, guess: Pose2, match: ScanMatch) -> None:
        """Update `covariance_scale` by a scan match of the keyframe that the wheels put at `guess`.

        It follows the squared Mahalanobis distance between the two over its 3 degrees of freedom, which is 1 where
        both covariances are right.
        """
        T = match.T_submap_scan
        e = np.array([T.x - guess.x, T.y - guess.y, wrap(T.theta - guess.theta)])
        expected = wheel_covariance(motion, self._odometry) + match.covariance
        scale = min(float(e @ np.linalg.solve(expected, e)) / 3, self._trust.most)
        self.covariance_scale = max(1.0, self._trust.memory * self.covariance_scale + (1 - self._trust.memory) * scale)
