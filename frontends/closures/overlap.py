"""Where a scan contradicts a submap: it has a wall where rays of the submap's scans have passed.

A laser that returns along a corridor the other way sees little of what it saw before. Its points out of the earlier
scans' sight then fit nothing, and yet contradict nothing.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.closures.closure_config import OverlapConfig
from wayfi.frontends.scan_points import ScanPoints


def agreement(
    inlier_ratio: float,
    scan: ScanPoints,
    T_submap_scan: Pose2,
    submap_scans: list[ScanPoints],
    submap_poses: Floats,
    config: OverlapConfig,
) -> float:
    """Of the points of `scan` that fit the submap or contradict it, the share that fits; see `seen_through`."""
    through = seen_through(scan, T_submap_scan, submap_scans, submap_poses, config)
    fitting = inlier_ratio * len(scan.points)
    return fitting / max(fitting + through, 1.0)


def seen_through(
    scan: ScanPoints, T_submap_scan: Pose2, submap_scans: list[ScanPoints], submap_poses: Floats, config: OverlapConfig
) -> int:
    """How many points of `scan` lie where one of `submap_scans`, at (n, 3) `submap_poses`, has seen nothing.

    That is between two neighbouring rays of it that both go `margin_m` or more beyond the point.
    """
    points = T_submap_scan.transform(scan.points)
    passed = np.zeros(len(points), np.bool_)
    for other, pose in zip(submap_scans, submap_poses, strict=True):
        T_submap_laser = Pose2.of(pose) @ other.T_base_laser
        bearings, ranges = _polar(other.T_base_laser.inverse().transform(other.points))
        order = np.argsort(bearings, kind="stable")
        at_bearings, at_ranges = _polar(T_submap_laser.inverse().transform(points))
        passed |= _passed(at_bearings, at_ranges, bearings[order], ranges[order], config.ray_gap_rad, config.margin_m)
    return int(passed.sum())


def _polar(points: Floats) -> tuple[Floats, Floats]:
    return np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])


@njit(cache=True)
def _passed(
    at_bearings: Floats, at_ranges: Floats, bearings: Floats, ranges: Floats, gap_rad: float, margin_m: float
) -> NDArray[np.bool_]:
    """(m,) whether two rays of sorted `bearings` (n,) rad, at most `gap_rad` apart, pass a point on both sides."""
    passed = np.zeros(at_bearings.shape[0], np.bool_)
    for i in range(at_bearings.shape[0]):
        k = np.searchsorted(bearings, at_bearings[i])
        if 0 < k < bearings.shape[0] and bearings[k] - bearings[k - 1] <= gap_rad:
            passed[i] = min(ranges[k - 1], ranges[k]) >= at_ranges[i] + margin_m
    return passed
