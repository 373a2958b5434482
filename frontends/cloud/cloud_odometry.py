"""The motion between clouds by KISS-ICP: from keyframe to keyframe beside the wheels, or alone where there are none."""

from dataclasses import replace

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.cloud.cloud_fit import fit_cloud
from wayfi.frontends.cloud.cloud_map import CloudMap
from wayfi.frontends.cloud.height_band import undo_motion
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.scan_matching import ScanMatch, match_covariance, without_prior
from wayfi.frontends.lidar.scan_tracker import Tracked

LONGEST_GAP_S = 1.0  # that a motion goes on as it was
SHORTEST_STEP_S = 0.15  # of 10 clouds a second every other one is registered: half the work, and as good a map


class CloudOdometry:
    """Registers the cloud of each keyframe to those before it."""

    def __init__(self, config: LidarConfig) -> None:
        self._config = config
        self._map = CloudMap(config.cloud, config.max_range_m)
        cloud = config.cloud
        self._floors = replace(config, sigma_floor_m=cloud.sigma_floor_m, sigma_floor_rad=cloud.sigma_floor_rad)
        self._pose = Pose2()
        self._keyframe = -1

    def match(self, points: Floats, keyframe: int, guess: Pose2, guess_covariance: Floats) -> Tracked | None:
        """T_before_keyframe of the band's points (n, 3), from `guess`; None without a cloud at the keyframe before.

        A match under `min_inlier_ratio` is none: from there the map begins anew.
        """
        follows = keyframe == self._keyframe + 1 and not self._map.empty
        self._keyframe = keyframe
        thinned = self._map.thinned(points)
        if not follows:
            self._begin(thinned)
            return None
        before, map_points = self._pose, self._map.points()
        match = self._register(thinned, map_points, guess, guess_covariance)
        return Tracked(match, before.inverse().transform(self._map.keypoints(map_points)[:, :2]))

    def _register(self, thinned: Floats, map_points: Floats, guess: Pose2, guess_covariance: Floats) -> ScanMatch:
        expected = self._pose @ guess
        aligned = self._map.align(self._map.keypoints(thinned), expected)
        R = _rotation(self._pose.theta)
        prior = R @ np.linalg.inv(guess_covariance) @ R.T
        fit = fit_cloud(thinned, map_points, aligned, expected, prior)
        covariance = R.T @ match_covariance(fit, self._floors) @ R
        alone = self._pose.between(without_prior(fit, expected, prior, self._config))
        match = ScanMatch(alone, covariance, fit.inlier_ratio, fit.residual_m)
        if fit.inlier_ratio < self._config.min_inlier_ratio:
            self._begin(thinned)
        else:
            self._pose = fit.T_target_scan
            self._map.add(thinned, self._pose)
        return match

    def _begin(self, thinned: Floats) -> None:
        self._map.clear()
        self._pose = Pose2()
        self._map.add(thinned, self._pose)


class CloudLead:
    """Odometry from clouds alone: the motion goes on as it was, as a first guess and within a sweep."""

    def __init__(self, config: LidarConfig) -> None:
        self._config = config
        self._map = CloudMap(config.cloud, config.max_range_m)
        self._pose, self._velocity = Pose2(), np.zeros(3)
        self._stamp_ns = 0

    def register(self, stamp_ns: int, points: Floats, time_s: Floats) -> Pose2:
        """T_odom_base at `stamp_ns` from the band's points (n, 3) in base_link, each taken `time_s` (n,) after it."""
        seconds = (stamp_ns - self._stamp_ns) * 1e-9
        if len(points) == 0 or (seconds < SHORTEST_STEP_S and not self._map.empty):
            return self._pose @ Pose2.of(self._velocity * min(seconds, LONGEST_GAP_S))
        if seconds > LONGEST_GAP_S:
            self._velocity = np.zeros(3)
        ends = np.array([time_s.min(), time_s.max()])
        thinned = self._map.thinned(undo_motion(points, time_s, ends, ends[:, None] * self._velocity))
        if not self._map.empty:
            pose = self._registered(thinned, seconds)
            self._velocity, self._pose = self._pose.between(pose).array() / seconds, pose
        self._map.add(thinned, self._pose)
        self._stamp_ns = stamp_ns
        return self._pose

    def _registered(self, thinned: Floats, seconds: float) -> Pose2:
        """The pose of a cloud, `seconds` after the one before; that which the motion leads to where it fits nothing."""
        expected = self._pose @ Pose2.of(self._velocity * seconds)
        keypoints = self._map.keypoints(thinned)
        aligned = self._map.align(keypoints, expected)
        cloud = self._config.cloud
        turned = np.array([cloud.acceleration_m_s2, cloud.acceleration_m_s2, cloud.acceleration_rad_s2]) * seconds**2
        fit = fit_cloud(keypoints, self._map.points(), aligned, expected, np.diag(turned**-2.0))
        if fit.inlier_ratio >= self._config.min_inlier_ratio:
            return fit.T_target_scan
        self._map.clear()
        return expected


def _rotation(theta: float) -> Floats:
    """(3, 3) that turns (x, y, theta) of a frame at `theta` into those of its parent's axes."""
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
