"""The wide search for a robot that is not where its wheels lead: any heading, some metres around."""

from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.options import option
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.lidar.correlative import BLUR_SIGMAS, CorrelativeConfig, SearchWindow, build_field, search
from wayfi.frontends.lidar.icp import IcpConfig, IcpResult, icp
from wayfi.frontends.lidar.point_index import PointIndex
from wayfi.frontends.lidar.visibility import seen_through_share
from wayfi.frontends.scan_points import ScanPoints


@dataclass(frozen=True)
class RelocationConfig:
    """The window of the wide search, and when what it finds is the one place that it can be."""

    window_m: float = option(4.0, "m", "to each side; with all headings 14 million look-ups, some 20 ms")
    window_rad: float = option(3.1416, "rad", "as above: a turn that the odometry missed may be any")
    points: int = option(100, "", "half of the usual search's: the cost again")
    max_coarse_cells: int = option(3000, "", "coarse cells opened: five times the usual search's, of 50 times as many")
    angle_step: float = option(0.02, "rad", "0.2 m at 10 m, which the field's blur covers")
    min_inlier_ratio: float = option(0.85, "", "with a free choice of the pose a mirrored hall fitted to 0.82")
    max_second_peak: float = option(0.85, "", "of the best score: nearer than this the place is ambiguous")
    max_seen_through: float = option(0.15, "", "of the walls in view; sound matches had 0.01 to 0.15")


def any_heading(config: RelocationConfig, grid: CorrelativeConfig) -> CorrelativeConfig:
    """The bounds of a search of all headings: fewer points and angles, so that it costs a few usual searches."""
    points, cells = config.points, config.max_coarse_cells
    return replace(grid, points=points, angle_step=config.angle_step, max_coarse_cells=cells)


def relocate(
    scan: ScanPoints,
    submap: PointIndex,
    guess: Pose2,
    config: RelocationConfig,
    grid: CorrelativeConfig,
    fit: IcpConfig,
) -> IcpResult | None:
    """The one pose of `scan` in the window around `guess` that fits the submap; None if there is none, or several."""
    coarse = any_heading(config, grid)
    window = SearchWindow(config.window_m, config.window_rad, np.zeros((3, 3)), np.inf)
    peak = search(scan.points, build_field(submap.points, grid), guess, window, coarse)
    result = icp(scan, submap, peak.pose, np.zeros((3, 3)), fit)
    alone = peak.second_score <= config.max_second_peak * peak.score
    stayed = peak.pose.distance(result.T_target_scan) <= BLUR_SIGMAS * grid.blur_m
    fits = result.inlier_ratio >= config.min_inlier_ratio
    if not (alone and stayed and fits):
        return None
    through = seen_through_share(scan, submap.points, result.T_target_scan)
    return result if through <= config.max_seen_through else None
