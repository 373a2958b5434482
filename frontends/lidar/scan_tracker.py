"""Scan matching from keyframe to keyframe, and the scale of the wheels' covariance that agrees with it."""

import math
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.keyframes import Keyframes
from wayfi.frontends.lidar.doubt import (
    AGREES,
    SILENT,
    UNFIT,
    Finding,
    StepJudged,
    blind,
    misfit,
    misses,
    slipped,
    unfit,
)
from wayfi.frontends.lidar.icp import inlier_ratio
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.point_index import PointIndex
from wayfi.frontends.lidar.relocation import Sight, has_rival, relocate
from wayfi.frontends.lidar.scan_matching import ScanMatch, SubmapRays, as_match, match_scan, merge_submap
from wayfi.frontends.lidar.visibility import seen_through_share
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.wheel_noise import wheel_covariance
from wayfi.frontends.scan_points import ScanPoints

SURER = 4.0  # of squared Mahalanobis distances: wheels that are twice as sure as a match of what parts them


@dataclass(frozen=True, slots=True, eq=False)
class KeyframeMatch:
    """A keyframe's scan match in the frame of the keyframe before, and the `submap` (n, 2) m of the match there.

    `judged` is what it says of the wheels.
    """

    match: ScanMatch
    submap: Floats
    judged: StepJudged = SILENT

    @property
    def refused(self) -> bool:
        """Whether the scan does not fit, or fits only where wheels that are surer do not lead."""
        return self.judged.finding in (Finding.UNFIT, Finding.MISFIT)


class ScanTracker:
    """Matches each keyframe's scan to a submap of the ones before it.

    `covariance_scale` (>= 1) multiplies the wheels' covariance, so that they agree with the laser.
    """

    def __init__(self, keyframes: Keyframes, lidar: LidarConfig, odometry: OdometryConfig) -> None:
        self._keyframes = keyframes
        self._lidar, self._odometry, self._trust = lidar, odometry, lidar.trust
        self.covariance_scale = 1.0
        self._matched = False
        self._compared: tuple[ScanPoints, Pose2, float] | None = None  # last: the scan, from which guess and scale
        self._found: KeyframeMatch | None = None  # then

    def wheel_covariance(self, motion: WheelMotion) -> Floats:
        """(3, 3) covariance of a wheel motion, scaled."""
        return wheel_covariance(motion, self._odometry, self.covariance_scale)

    def match(self, scan: ScanPoints, motion: WheelMotion, guess: Pose2, poses: Floats) -> KeyframeMatch | None:
        """Match the scan of the keyframe `guess` away from the last of `poses` (n, 3); None without a submap."""
        if not self._matched:
            self._matched, self.covariance_scale = True, self._trust.initial
        tracked = self._found_before(scan, guess) or self.compare(scan, motion, guess, poses)
        if tracked and not tracked.refused:
            self.update_scale(motion, guess, tracked.match)
        return tracked

    def compare(self, scan: ScanPoints, motion: WheelMotion, guess: Pose2, poses: Floats) -> KeyframeMatch | None:
        """As `match`, but nothing is learnt from it; `match` uses the result if the scan becomes a keyframe at once."""
        self._compared, self._found = (scan, guess, self.covariance_scale), self._compare(scan, motion, guess, poses)
        return self._found

    def _found_before(self, scan: ScanPoints, guess: Pose2) -> KeyframeMatch | None:
        """The match of the scan that was compared last, if it would be the same now; the wide search takes 50 ms."""
        before, from_guess, scale = self._compared or (None, None, 0.0)
        same = before is scan and from_guess == guess and scale == self.covariance_scale
        return self._found if same else None

    def _compare(self, scan: ScanPoints, motion: WheelMotion, guess: Pose2, poses: Floats) -> KeyframeMatch | None:
        n = len(poses)
        first = max(n - self._lidar.submap_keyframes, self._keyframes.piece(n - 1)[0])
        scans, placed = self._keyframes.scans_around(first, n, poses[-1], poses)
        submap = merge_submap(scans, placed, self._lidar.cell_m)
        if submap is None or len(scan.points) < self._lidar.min_points:
            return None
        if motion.blind_s > 0.0:
            return self._found_blind(scan, submap, Sight(scans, placed), motion, guess)
        poor = self.covariance_scale > self._trust.search_above
        search_below, rays = math.inf if poor else self._lidar.search_below, SubmapRays(scans, placed, not poor)
        covariance = self.wheel_covariance(motion)
        match = match_scan(scan, submap, guess, covariance, search_below, self._lidar, rays)
        tracked = KeyframeMatch(match, submap.points, AGREES)
        if match.inlier_ratio < self._lidar.search_below:
            tracked = self._doubted(scan, submap, guess, tracked)
        if tracked.match.inlier_ratio < self._lidar.min_inlier_ratio:
            return replace(tracked, judged=self._refused(scan, tracked, motion, guess))
        return replace(tracked, judged=self._judge(scan, submap, motion, guess, tracked.match))

    def _found_blind(
        self, scan: ScanPoints, submap: PointIndex, sight: Sight, motion: WheelMotion, guess: Pose2
    ) -> KeyframeMatch:
        """The one place nearby that a scan fits, after a motion of which nothing told; refused if there is none."""
        found = relocate(scan, submap, guess, self._lidar)
        if found and not has_rival(scan, submap, sight, found.T_target_scan, self._lidar):
            return KeyframeMatch(as_match(found, found.T_target_scan, self._lidar), submap.points, AGREES)
        unknown = ScanMatch(guess, self.wheel_covariance(motion), 0.0, math.nan)
        return KeyframeMatch(unknown, submap.points, blind(motion, self._lidar.doubt))

    def _doubted(self, scan: ScanPoints, submap: PointIndex, guess: Pose2, tracked: KeyframeMatch) -> KeyframeMatch:
        """A poor match, or what the wide search finds instead where the scan looks through the submap's walls."""
        if not self._contradicts(scan, tracked):
            return tracked
        found = relocate(scan, submap, guess, self._lidar)
        if found is None or found.inlier_ratio < tracked.match.inlier_ratio + self._lidar.doubt.slip_gain:
            return tracked
        return replace(tracked, match=as_match(found, found.T_target_scan, self._lidar))

    def _contradicts(self, scan: ScanPoints, tracked: KeyframeMatch) -> bool:
        through = seen_through_share(scan, tracked.submap, tracked.match.T_submap_scan, self._lidar.visibility)
        return through > self._lidar.doubt.seen_through

    def _refused(self, scan: ScanPoints, tracked: KeyframeMatch, motion: WheelMotion, guess: Pose2) -> StepJudged:
        if self._contradicts(scan, tracked):
            return misfit(motion, self._lidar.doubt)
        nearly = tracked.match.inlier_ratio >= self._lidar.doubt.nearly * self._lidar.min_inlier_ratio
        return unfit(guess, tracked.match.T_submap_scan) if nearly else UNFIT

    def _judge(
        self, scan: ScanPoints, submap: PointIndex, motion: WheelMotion, guess: Pose2, match: ScanMatch
    ) -> StepJudged:
        """Whether a good match contradicts the wheels by far more than both covariances.

        Where the wheels miss most of the motion it is their failure, not noise that the covariance scale describes.
        Wheels that are far surer than the match are believed: what somebody before the laser shows fits in many places.
        """
        doubt, T = self._lidar.doubt, match.T_submap_scan
        e = guess.error_of(T)
        scale = min(self.covariance_scale, self._trust.initial) if misses(motion, e) else self.covariance_scale
        wheels = wheel_covariance(motion, self._odometry, scale)
        chi2 = float(e @ np.linalg.solve(wheels + match.covariance, e))
        if chi2 < doubt.agree_chi2:
            return AGREES
        small = math.hypot(e[0], e[1]) < doubt.slip_m and abs(e[2]) < doubt.slip_rad
        far = chi2 > doubt.slip_chi2 and not small
        if far and e @ np.linalg.solve(wheels, e) > SURER * (e @ np.linalg.solve(match.covariance, e)):
            return UNFIT
        near = replace(self._lidar.icp, inlier_m=0.5 * doubt.slip_m)
        gain = inlier_ratio(scan, submap, T, near) - inlier_ratio(scan, submap, guess, near)
        slips = far and gain > doubt.slip_gain
        return slipped(motion, guess, T) if slips else SILENT

    def update_scale(self, motion: WheelMotion, guess: Pose2, match: ScanMatch) -> None:
        """Update `covariance_scale` by a scan match of the keyframe that the wheels put at `guess`.

        It follows the squared Mahalanobis distance between the two over its 3 degrees of freedom, which is 1 where
        both covariances are right.
        """
        e = guess.error_of(match.T_submap_scan)
        expected = wheel_covariance(motion, self._odometry) + match.covariance
        scale = min(float(e @ np.linalg.solve(expected, e)) / 3, self._trust.most)
        self.covariance_scale = max(1.0, self._trust.memory * self.covariance_scale + (1 - self._trust.memory) * scale)
