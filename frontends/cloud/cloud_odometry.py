"""The motion between clouds by KISS-ICP: from keyframe to keyframe with the wheels as a prior, or without wheels."""

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, covariance_in_b
from wayfi.frontends.cloud.cloud_fit import fit_cloud
from wayfi.frontends.cloud.cloud_map import CloudMap
from wayfi.frontends.cloud.height_band import deskew
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.scan_matching import ScanMatch, match_covariance, without_prior
from wayfi.frontends.lidar.scan_tracker import KeyframeMatch
from wayfi.frontends.measurements import NANOSECOND_S


class CloudOdometry:
    """Matches the cloud of each keyframe to those before it."""

    def __init__(self, config: LidarConfig) -> None:
        self._config = config
        self._map = CloudMap(config.cloud, config.max_range_m)
        self._pose = Pose2()
        self._keyframe = -1

    def match(self, points: Floats, keyframe: int, guess: Pose2, guess_covariance: Floats) -> KeyframeMatch | None:
        """Match the band's points (n, 3) m of a keyframe, which is expected at `guess` in the keyframe before.

        None without a cloud at the keyframe before. After a match under `min_inlier_ratio` the map starts again from
        this cloud.
        """
        follows = keyframe == self._keyframe + 1 and not self._map.empty
        self._keyframe = keyframe
        thinned = self._map.thinned(points)
        if not follows:
            self._restart(thinned)
            return None
        before, map_points = self._pose, self._map.points()
        match = self._match_to_map(thinned, map_points, guess, guess_covariance)
        return KeyframeMatch(match, before.inverse().transform(self._map.keypoints(map_points)[:, :2]))

    def _match_to_map(self, thinned: Floats, map_points: Floats, guess: Pose2, guess_covariance: Floats) -> ScanMatch:
        expected = self._pose @ guess
        aligned = self._map.align(self._map.keypoints(thinned), expected)
        theta = self._pose.theta
        prior = covariance_in_b(np.asarray(np.linalg.inv(guess_covariance), np.float64), -theta)
        cloud = self._config.cloud
        fit = fit_cloud(thinned, map_points, aligned, expected, prior, cloud.fit)
        covariance_in_map = match_covariance(
            fit, self._config.degenerate_below, cloud.sigma_floor_m, cloud.sigma_floor_rad
        )
        covariance = covariance_in_b(covariance_in_map, theta)
        alone = self._pose.between(without_prior(fit, expected, prior, self._config))
        match = ScanMatch(alone, covariance, fit.inlier_ratio, fit.residual_m)
        if fit.inlier_ratio < self._config.min_inlier_ratio:
            self._restart(thinned)
        else:
            self._pose = fit.T_target_scan
            self._map.add(thinned, self._pose)
        return match

    def _restart(self, thinned: Floats) -> None:
        self._map.clear()
        self._pose = Pose2()
        self._map.add(thinned, self._pose)


class CloudLead:
    """Odometry from clouds alone, at constant velocity: the first guess, and the motion within a sweep."""

    def __init__(self, config: LidarConfig) -> None:
        self._config = config
        self._map = CloudMap(config.cloud, config.max_range_m)
        self._pose, self._velocity = Pose2(), np.zeros(3)
        self._stamp_ns = 0

    def match(self, stamp_ns: int, points: Floats, time_s: Floats) -> Pose2:
        """T_odom_base at `stamp_ns` from the band's points (n, 3) in base_link, each taken `time_s` (n,) after it."""
        cloud, seconds = self._config.cloud, (stamp_ns - self._stamp_ns) * NANOSECOND_S
        if len(points) == 0 or (seconds < cloud.shortest_step_s and not self._map.empty):
            return self._pose @ Pose2.of(self._velocity * min(seconds, cloud.longest_gap_s))
        if seconds > cloud.longest_gap_s:
            self._velocity = np.zeros(3)
        ends = np.array([time_s.min(), time_s.max()])
        thinned = self._map.thinned(deskew(points, time_s, ends, ends[:, None] * self._velocity))
        if not self._map.empty:
            pose = self._matched(thinned, seconds)
            self._velocity, self._pose = self._pose.between(pose).array() / seconds, pose
        self._map.add(thinned, self._pose)
        self._stamp_ns = stamp_ns
        return self._pose

    def _matched(self, thinned: Floats, seconds: float) -> Pose2:
        """The pose of a cloud, `seconds` after the one before; the predicted one where too little of it fits."""
        expected = self._pose @ Pose2.of(self._velocity * seconds)
        keypoints = self._map.keypoints(thinned)
        aligned = self._map.align(keypoints, expected)
        cloud = self._config.cloud
        sigmas = np.array([cloud.acceleration_m_s2, cloud.acceleration_m_s2, cloud.acceleration_rad_s2]) * seconds**2
        fit = fit_cloud(keypoints, self._map.points(), aligned, expected, np.diag(sigmas**-2.0), cloud.fit)
        if fit.inlier_ratio >= self._config.min_inlier_ratio:
            return fit.T_target_scan
        self._map.clear()
        return expected
