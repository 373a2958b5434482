"""Why nothing, or too little, of what a laser sends can be used, and what to set so that it can."""

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.lidar.lidar_config import CloudConfig
from wayfi.frontends.measurements import LaserScan, PointCloud

BAND_SPARE_M = 0.05  # around the points, of the height band that is advised


def why_no_return(scan: LaserScan, max_range_m: float) -> str:
    """Why none of the beams that returned is used; empty where none did, or for more than one reason.

    One range in all of them is what a driver sends where nothing returns.
    """
    returns = scan.ranges[np.isfinite(scan.ranges) & (scan.ranges > 0)]
    nearest, furthest = (float(returns.min()), float(returns.max())) if len(returns) else (0.0, 0.0)
    if nearest == furthest:
        return ""
    seen = f"none of its beams can be used: they end between {nearest:.2f} and {furthest:.2f} m, "
    if furthest <= scan.range_min_m:
        return f"{seen}below its range_min of {scan.range_min_m:g} m; correct its driver"
    if nearest >= scan.range_max_m:
        return f"{seen}beyond its range_max of {scan.range_max_m:g} m; correct its driver"
    if nearest >= max_range_m:
        return f"{seen}beyond lidar.max_range_m, {max_range_m:g} m (--set lidar.max_range_m={furthest:.0f})"
    return ""


def why_no_point(cloud: PointCloud, max_range_m: float) -> str:
    """Why no point of a cloud is near enough to be used, and off the robot itself."""
    away_m = np.linalg.norm(cloud.points[np.isfinite(cloud.points).all(axis=1)].astype(np.float64), axis=1)
    if len(away_m) == 0:
        return "none of its points is finite" if len(cloud.points) else "its clouds hold no points"
    nearest, furthest = float(away_m.min()), float(away_m.max())
    seen = f"none of its points can be used: they are between {nearest:.2f} and {furthest:.2f} m away"
    return f"{seen}, lidar.max_range_m is {max_range_m:g} m; are they in metres?"


def why_no_band(heights_m: Floats, config: CloudConfig) -> str:
    """Why none of a cloud's points is in the height band; `heights_m` (n,) are those of the points near enough."""
    low, high = np.percentile(heights_m, [1, 99]).tolist()
    band = f"nothing of its clouds lies in the height band, between {config.low_m:g} and {config.high_m:g} m"
    low_m, high_m = low - BAND_SPARE_M, high + BAND_SPARE_M
    settings = f"--set lidar.cloud.low_m={low_m:.2f} --set lidar.cloud.high_m={high_m:.2f}"
    seen = f"its points are between {low:.2f} and {high:.2f} m"
    return f"{band} above the base: {seen}; is its mount's height right? If so: {settings}"


def why_few_points(points: int, beams: NDArray[np.generic], min_points: int) -> str:
    """Why a scan that keeps so many of its `beams` (n,) is not matched."""
    sent, advice = len(beams), f"--set lidar.min_points={max(points, 3)}" if points else "look for what covers it"
    return f"few beams: {points} points are left of the {sent} that it sends, and a match takes {min_points} ({advice})"
