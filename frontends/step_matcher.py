"""Scan matching of one step, planar or 3D, and what it says of the wheels: covariance, and the doubt that is left."""

import math

from wayfi.backend.graph.health import Health
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.cloud.cloud_odometry import CloudOdometry
from wayfi.frontends.keyframes import Keyframes
from wayfi.frontends.lidar.doubt import Doubt, Finding, StepJudged
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.scan_tracker import KeyframeMatch, ScanTracker
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.scan_points import PlacedScan


class StepMatcher:
    """Matches the sweeps of keyframes to those before, and keeps what the last ones say of the wheels."""

    def __init__(self, keyframes: Keyframes, lidar: LidarConfig, odometry: OdometryConfig) -> None:
        self._lidar, self._odometry = lidar, odometry
        self._tracker = ScanTracker(keyframes, lidar, odometry)
        self._clouds = CloudOdometry(lidar)
        self._doubt = Doubt(lidar.doubt)

    @property
    def covariance_scale(self) -> float:
        """The factor on the wheels' covariance that agrees with scan matching."""
        return self._tracker.covariance_scale

    @property
    def doubt(self) -> Health | None:
        """The doubt that laser and wheels leave; None where they agree."""
        return self._doubt.health

    def keyframe_factor(self) -> float:
        """A factor on the distance between keyframes, below 1 where scan matching finds the wheels poor."""
        least = self._odometry.keyframe_min_factor
        return least if self.doubt else max(least, 1.0 / math.sqrt(self.covariance_scale))

    def look_due_s(self) -> float:
        """How long (s) after a scan the next one is to be looked at while the wheels stand still."""
        return self._lidar.doubt.look_again_s if self._doubt.unsettled else self._lidar.doubt.look_s

    def leapt(self, metres: float, radians: float) -> None:
        """The odometry leapt, which counted as no motion: the pose is in doubt until scans tell."""
        self._doubt.leapt(metres, radians)

    def match(
        self, placed: PlacedScan, motion: WheelMotion, guess: Pose2, number: int, poses: Floats
    ) -> KeyframeMatch | None:
        """Match the cloud of keyframe `number` by KISS-ICP where there is one that it can place, else its scan.

        The wheels put it at `guess`, after `motion` from the last of `poses` (n, 3). None without a submap.
        """
        if placed.band is not None and motion.blind_s == 0.0:
            tracked = self._clouds.match(placed.band, number, guess, self._tracker.wheel_covariance(motion))
            if tracked and self.accepts(tracked):
                self._tracker.update_scale(motion, guess, tracked.match)
                return tracked
        return self._tracker.match(placed.points, motion, guess, poses)

    def look(self, placed: PlacedScan, motion: WheelMotion, guess: Pose2, poses: Floats) -> bool:
        """Compare a scan that was taken while the wheels stood; returns whether the robot moved all the same."""
        tracked = self._tracker.compare(placed.points, motion, guess, poses)
        judged = tracked.judged if tracked else StepJudged(Finding.SILENT)
        if judged.finding in (Finding.SLIPPED, Finding.MISFIT):
            return True
        self._doubt.add(judged)
        return False

    def wheel_covariance(self, motion: WheelMotion, tracked: KeyframeMatch | None) -> Floats:
        """(3, 3) covariance of a step's wheels, with what its scan says of them; to be called once for each step."""
        covariance = self._tracker.wheel_covariance(motion)
        return covariance + self._doubt.add(tracked.judged) if tracked else covariance

    def accepts(self, tracked: KeyframeMatch) -> bool:
        """Whether a match is good enough to be a factor."""
        return tracked.match.inlier_ratio >= self._lidar.min_inlier_ratio and not tracked.refused

    def first_guess(self, guess: Pose2, tracked: KeyframeMatch | None) -> Pose2:
        """Where the optimisation begins: where the wheels lead, unless the wide search found the robot elsewhere."""
        if tracked is None or not self.accepts(tracked):
            return guess
        T, window = tracked.match.T_submap_scan, self._lidar.search
        turned = abs(guess.between(T).theta)
        return T if guess.distance(T) > window.max_window_m or turned > window.max_window_rad else guess
