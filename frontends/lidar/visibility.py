"""Where a scan's rays pass points that another scan or the map saw: one of the two is not where it is thought to be.

A point that is hidden from the scan, or out of its view, says nothing. So people around the robot, a room that is new,
and a laser that returns along a corridor the other way make no contradiction; a robot that was carried elsewhere does.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.scan_points import ScanPoints


@dataclass(frozen=True)
class VisibilityConfig:
    """When a ray passes a point, and how many points in view are evidence."""

    ray_gap_rad: float = option(0.1, "rad", "between neighbouring rays: points are thinned to 6 cm of wall, at 0.6 m")
    margin_m: float = option(0.3, "m", "of range: what a pose off by some centimetres and a slanting wall leave")
    min_in_view: int = option(20, "points", "of the map; fewer are no evidence")


@dataclass(frozen=True, slots=True, eq=False)
class InView:
    """Which of (n,) points in a scan's view its rays pass, and which they meet or end just before."""

    passed: NDArray[np.bool_]
    met: NDArray[np.bool_]


def in_view(scan: ScanPoints, T_points_base: Pose2, points: Floats, config: VisibilityConfig) -> InView:
    """Of `points` (n, 2) m, those in the view of a scan taken at `T_points_base`.

    A point is in view between two neighbouring rays. They pass it if both go `margin_m` or more beyond it, and meet it
    if the longer one ends no further before it.
    """
    bearings, ranges = _polar(scan.T_base_laser.inverse().transform(scan.points))
    order = np.argsort(bearings, kind="stable")
    at_bearings, at_ranges = _polar((T_points_base @ scan.T_base_laser).inverse().transform(points))
    rays = _closed(bearings[order], ranges[order])
    return InView(*_passed_and_met(at_bearings, at_ranges, *rays, config.ray_gap_rad, config.margin_m))


def seen_through_share(scan: ScanPoints, walls: Floats, T_walls_base: Pose2, config: VisibilityConfig) -> float:
    """The share, 0 to 1, of `walls` (n, 2) m in the view of a scan taken at `T_walls_base` that its rays pass.

    0.0 where fewer than `min_in_view` are in view.
    """
    view = in_view(scan, T_walls_base, walls, config)
    passed = int(view.passed.sum())
    count = passed + int(view.met.sum())
    return passed / count if count >= config.min_in_view else 0.0


def agreement(
    inlier_ratio: float,
    scan: ScanPoints,
    T_submap_scan: Pose2,
    submap_scans: list[ScanPoints],
    submap_poses: Floats,
    config: VisibilityConfig,
) -> float:
    """Of the points of `scan` that fit the submap or contradict it, the share that fits; see `seen_through_count`."""
    through = seen_through_count(scan, T_submap_scan, submap_scans, submap_poses, config)
    fitting = inlier_ratio * len(scan.points)
    return fitting / max(fitting + through, 1.0)


def seen_through_count(
    scan: ScanPoints,
    T_submap_scan: Pose2,
    submap_scans: list[ScanPoints],
    submap_poses: Floats,
    config: VisibilityConfig,
) -> int:
    """How many points of `scan` the rays of at least one of `submap_scans`, at (n, 3) `submap_poses`, pass."""
    return int(_from_submap(scan, T_submap_scan, submap_scans, submap_poses, config).passed.sum())


def fit_in_sight(
    inlier_ratio: float,
    scan: ScanPoints,
    T_submap_scan: Pose2,
    submap_scans: list[ScanPoints],
    submap_poses: Floats,
    config: VisibilityConfig,
) -> float:
    """Of the points of `scan` where the submap's scans saw a wall or nothing, the share that fits the submap.

    Points that those scans could not see, as ahead in a corridor, do not count.
    """
    view = _from_submap(scan, T_submap_scan, submap_scans, submap_poses, config)
    fitting = inlier_ratio * len(scan.points)
    return fitting / max(fitting, float((view.passed | view.met).sum()), 1.0)


def _from_submap(
    scan: ScanPoints,
    T_submap_scan: Pose2,
    submap_scans: list[ScanPoints],
    submap_poses: Floats,
    config: VisibilityConfig,
) -> InView:
    """Which points of `scan` at least one of the submap's scans passes, and which one meets."""
    points = T_submap_scan.transform(scan.points)
    passed, met = np.zeros(len(points), np.bool_), np.zeros(len(points), np.bool_)
    for other, pose in zip(submap_scans, submap_poses, strict=True):
        view = in_view(other, Pose2.of(pose), points, config)
        passed |= view.passed
        met |= view.met
    return InView(passed, met)


def _polar(points: Floats) -> tuple[Floats, Floats]:
    """(n,) bearings (rad) and ranges (m) of points (n, 2) m."""
    return np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])


def _closed(bearings: Floats, ranges: Floats) -> tuple[Floats, Floats]:
    """Sorted bearings with the last one before and the first one after them, a turn away."""
    turn = 2 * math.pi
    around = np.concatenate([bearings[-1:] - turn, bearings, bearings[:1] + turn])  # np.r_ takes ten times as long
    return around, np.concatenate([ranges[-1:], ranges, ranges[:1]])


@njit(cache=True)
def _passed_and_met(
    at_bearings: Floats, at_ranges: Floats, bearings: Floats, ranges: Floats, gap_rad: float, margin_m: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """`InView` of points at bearings and ranges (n,), by rays of sorted bearings (m,) that go round."""
    passed, met = np.zeros(at_bearings.shape[0], np.bool_), np.zeros(at_bearings.shape[0], np.bool_)
    for i in range(at_bearings.shape[0]):
        k = np.searchsorted(bearings, at_bearings[i])
        if 0 < k < bearings.shape[0] and bearings[k] - bearings[k - 1] < gap_rad:
            passed[i] = at_ranges[i] < min(ranges[k - 1], ranges[k]) - margin_m
            met[i] = not passed[i] and at_ranges[i] < max(ranges[k - 1], ranges[k]) + margin_m
    return passed, met
