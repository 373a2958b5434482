"""The wide search for a robot that is not where its wheels lead: any heading, some metres around."""

from dataclasses import dataclass, replace

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


@dataclass(frozen=True, slots=True, eq=False)
class WideFit:
    """The best fit in the window, and whether it is the only one there that fits so well."""

    result: IcpResult
    alone: bool


def search_widely(scan: ScanPoints, submap: PointIndex, guess: Pose2, lidar: LidarConfig) -> WideFit:
    """The pose of `scan` in the window around `guess` that fits the submap best."""
    config, grid = lidar.relocation, lidar.correlative
    window = SearchWindow(config.window_m, config.window_rad, np.zeros((3, 3)), np.inf)
    peak = search(scan.points, build_field(submap.points, grid), guess, window, any_heading(config, grid))
    result = icp(scan, submap, peak.pose, np.zeros((3, 3)), lidar.icp)
    stayed = peak.pose.distance(result.T_target_scan) <= BLUR_SIGMAS * grid.blur_m
    return WideFit(result, stayed and peak.second_score <= config.max_second_peak * peak.score)


def relocate(scan: ScanPoints, submap: PointIndex, guess: Pose2, lidar: LidarConfig) -> IcpResult | None:
    """The one pose of `scan` in the window around `guess` that fits the submap; None if there is none, or several."""
    fit = search_widely(scan, submap, guess, lidar)
    if not fit.alone or fit.result.inlier_ratio < lidar.relocation.min_inlier_ratio:
        return None
    through = seen_through_share(scan, submap.points, fit.result.T_target_scan, lidar.visibility)
    return fit.result if through <= lidar.relocation.max_seen_through else None
