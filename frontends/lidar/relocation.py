"""The wide search for a robot that is not where its wheels lead: any heading, some metres around."""

from dataclasses import replace

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.lidar.correlative import BLUR_SIGMAS, CorrelativeConfig, SearchWindow, build_field, search
from wayfi.frontends.lidar.icp import IcpResult, icp
from wayfi.frontends.lidar.lidar_config import LidarConfig, RelocationConfig
from wayfi.frontends.lidar.point_index import PointIndex
from wayfi.frontends.lidar.visibility import seen_through_share
from wayfi.frontends.scan_points import ScanPoints


def any_heading(config: RelocationConfig, grid: CorrelativeConfig) -> CorrelativeConfig:
    """The bounds of a search of all headings: fewer points and angles, so that it costs a few usual searches."""
    points, cells = config.points, config.max_coarse_cells
    return replace(grid, points=points, angle_step=config.angle_step, max_coarse_cells=cells)


def relocate(scan: ScanPoints, submap: PointIndex, guess: Pose2, lidar: LidarConfig) -> IcpResult | None:
    """The one pose of `scan` in the window around `guess` that fits the submap; None if there is none, or several."""
    config, grid = lidar.relocation, lidar.correlative
    window = SearchWindow(config.window_m, config.window_rad, np.zeros((3, 3)), np.inf)
    peak = search(scan.points, build_field(submap.points, grid), guess, window, any_heading(config, grid))
    result = icp(scan, submap, peak.pose, np.zeros((3, 3)), lidar.icp)
    alone = peak.second_score <= config.max_second_peak * peak.score
    stayed = peak.pose.distance(result.T_target_scan) <= BLUR_SIGMAS * grid.blur_m
    fits = result.inlier_ratio >= config.min_inlier_ratio
    if not (alone and stayed and fits):
        return None
    through = seen_through_share(scan, submap.points, result.T_target_scan, lidar.visibility)
    return result if through <= config.max_seen_through else None
