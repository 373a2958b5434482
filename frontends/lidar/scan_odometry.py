"""Odometry from planar scans alone: a fit to the walls at constant velocity, from KISS-ICP's guess where that fails.

Points that are matched to points leave a robot in a bare corridor standing where it is. So a scan is matched to walls,
and along a direction that they leave open the robot goes on as fast as before: the remedy of X-ICP (Tuna et al., arXiv
2211.16335). How far it came there is not known, and grows less known by the second.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.lidar.correlative import SearchWindow, build_field, search
from wayfi.frontends.lidar.icp import IcpResult, icp
from wayfi.frontends.lidar.laser_odometry import LaserOdometry
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.point_index import PointIndex
from wayfi.frontends.lidar.scan_matching import constrained_directions, merge_submap
from wayfi.frontends.measurements import NANOSECOND_S
from wayfi.frontends.odometry.driven_path import LedStep
from wayfi.frontends.scan_points import ScanPoints

APART_M, APART_RAD = 0.3, 0.3  # between the scans of the submap: ICP's gate begins at 0.8 m


class Led(NamedTuple):
    """The pose `T_odom_base` that a sweep leads to, and what is known of the step."""

    T_odom_base: Pose2
    step: LedStep = LedStep()


class ScanOdometry:
    """Matches scans in their order; the frame of its poses drifts.

    `velocity` (3,) m/s and rad/s in base_link is assumed to go on until the next scan.
    """

    def __init__(self, config: LidarConfig, velocity: Floats | None = None) -> None:
        self._config = config
        self.velocity: Floats = np.zeros(3) if velocity is None else velocity
        self._kiss = LaserOdometry(config)
        self._T_kiss = self._T = Pose2()
        self._stamp_ns: int | None = None
        self._scans: deque[tuple[ScanPoints, Pose2]] = deque(maxlen=config.submap_keyframes)
        self._submap: PointIndex | None = None
        self._open_s = 0.0

    def match(self, stamp_ns: int, points: Floats, scan: ScanPoints) -> Led:
        """Match the next sweep, its `points` (n, 2) in base_link, m, and those as a `scan` with normals."""
        first = self._stamp_ns is None
        seconds = 0.0 if self._stamp_ns is None else (stamp_ns - self._stamp_ns) * NANOSECOND_S
        self._stamp_ns = stamp_ns
        blind = seconds > self._config.lead.longest_gap_s
        if blind:
            self.velocity = np.zeros(3)
        by_kiss = self._kiss_step(points, seconds)
        if first:
            self._extend(scan)
            return Led(self._T)
        expected, result = self._matched(scan, seconds, by_kiss)
        fits = result is not None and result.inlier_ratio >= self._config.min_inlier_ratio
        T, is_open = self._along_walls(expected, result) if result and fits else (self._T @ by_kiss, True)
        self.velocity, self._T = np.zeros(3) if blind else self._T.between(T).array() / seconds, T
        if blind or not fits:
            self._scans.clear()
        self._extend(scan)
        return Led(T, LedStep(self._grown_m2(seconds, is_open or blind), fits))

    def _kiss_step(self, points: Floats, seconds: float) -> Pose2:
        """The step by KISS-ICP, which is led to expect the present velocity."""
        self._kiss.expect(Pose2.of(self.velocity * seconds))
        before, self._T_kiss = self._T_kiss, self._kiss.match(points)
        return before.between(self._T_kiss)

    def _matched(self, scan: ScanPoints, seconds: float, by_kiss: Pose2) -> tuple[Pose2, IcpResult | None]:
        """Where a scan was expected, and where it fits best from there; None where too few points tell.

        Where that is poor, KISS-ICP's guess and the best in a window take the place of the one expected.
        """
        expected, config = self._T @ Pose2.of(self.velocity * seconds), self._config
        submap = self._submap_now() if len(scan.points) >= config.min_points else None
        if submap is None:
            return expected, None
        sigmas = np.array([config.lead.acceleration_m_s2] * 2 + [config.lead.acceleration_rad_s2]) * seconds**2
        result = icp(scan, submap, expected, np.diag(sigmas**-2.0), config.icp)
        if result.inlier_ratio < config.search_below:
            for guess in (self._T @ by_kiss, self._searched(scan, submap, expected, sigmas)):
                again = icp(scan, submap, guess, np.zeros((3, 3)), config.icp)
                if again.inlier_ratio > result.inlier_ratio + config.search.min_gain:
                    expected, result = guess, again
        return expected, result

    def _searched(self, scan: ScanPoints, submap: PointIndex, expected: Pose2, sigmas: Floats) -> Pose2:
        """The best pose of a scan in the window of the `sigmas` (3,) m, m, rad about the one expected."""
        bounds, correlative = self._config.search, self._config.correlative
        smallest, largest = (bounds.min_window_m, bounds.min_window_rad), (bounds.max_window_m, bounds.max_window_rad)
        window = SearchWindow.of(np.diag(sigmas**2), bounds.chi2, smallest, largest)
        return search(scan.points, build_field(submap.points, correlative), expected, window, correlative).pose

    def _along_walls(self, expected: Pose2, result: IcpResult) -> tuple[Pose2, bool]:
        """The pose that was found, but as `expected` along a direction that walls leave open; whether they do."""
        kept = constrained_directions(result.information, self._config.degenerate_below)
        off = result.T_target_scan.array() - expected.array()
        off[2] = wrap(off[2])
        return Pose2.of(expected.array() + kept @ off), not np.array_equal(kept, np.eye(3))

    def _grown_m2(self, seconds: float, is_open: bool) -> float:
        """By how much the variance of the place grows in a step: the speed errs, and by the same all the while."""
        before_s, self._open_s = self._open_s, self._open_s + seconds if is_open else 0.0
        speed = self._config.lead.open_m_s
        return speed**2 * (self._open_s**2 - before_s**2) if is_open else 0.0

    def _extend(self, scan: ScanPoints) -> None:
        """Add a scan at the newest pose to the submap, unless its newest is near."""
        if self._scans:
            _, newest = self._scans[-1]
            if newest.distance(self._T) < APART_M and abs(newest.between(self._T).theta) < APART_RAD:
                return
        self._scans.append((scan, self._T))
        self._submap = None

    def _submap_now(self) -> PointIndex | None:
        if self._submap is None and self._scans:
            scans, poses = zip(*self._scans, strict=True)
            placed = np.array([pose.array() for pose in poses])
            self._submap = merge_submap(list(scans), placed, self._config.cell_m)
        return self._submap
