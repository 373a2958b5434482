"""The wide search for a robot that is not where its wheels lead: any heading, some metres around."""

import math
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.correlative import (
    BLUR_SIGMAS,
    CorrelativeConfig,
    LikelihoodField,
    Peak,
    SearchWindow,
    build_field,
    max_pooled,
    search,
)
from wayfi.frontends.lidar.icp import IcpResult, icp, inlier_ratio
from wayfi.frontends.lidar.lidar_config import LidarConfig, RelocationConfig
from wayfi.frontends.lidar.point_index import PointIndex
from wayfi.frontends.lidar.visibility import VisibilityConfig, fit_in_sight, in_view, seen_through_share
from wayfi.frontends.scan_points import ScanPoints

RIVAL_M, TILES = 6.0, 7  # to each side, as far as the room next door, and the parts of it along each side
RIVAL_RAD = 0.2  # rad: rooms that look alike stand side by side
RIVAL_SCORE, RIVAL_OVERLAP = 0.7, 0.4  # with what was not seen; and of the points, those that fit
RIVAL_INFORMATION = np.diag([1.0 / 0.2**2, 1.0 / 0.2**2, 1.0 / 0.05**2])  # 1/m^2, 1/rad^2: it stays in its tile
COARSER = 4  # than the field are the cells of which it is asked whether a submap's scans saw them: the cost


def any_heading(config: RelocationConfig, grid: CorrelativeConfig) -> CorrelativeConfig:
    """The bounds of a search of all headings: fewer points and angles, so that it costs a few usual searches."""
    points, cells = config.points, config.max_coarse_cells
    return replace(grid, points=points, angle_step=config.angle_step, max_coarse_cells=cells)


@dataclass(frozen=True, slots=True, eq=False)
class WideFit:
    """The best fit in the window, and whether it is the only one there that fits so well."""

    result: IcpResult
    alone: bool


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """The scans that a submap is made of, at (n, 3) `poses` in its frame: they tell what it has not seen."""

    scans: list[ScanPoints]
    poses: Floats


def search_widely(scan: ScanPoints, submap: PointIndex, guess: Pose2, lidar: LidarConfig) -> WideFit:
    """The pose of `scan` in the window around `guess` that fits the submap best."""
    config, grid = lidar.relocation, lidar.correlative
    peak = _peak(scan, build_field(submap.points, grid), guess, lidar)
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


def has_rival(scan: ScanPoints, submap: PointIndex, sight: Sight, T: Pose2, lidar: LidarConfig) -> bool:
    """Whether a scan that fits at `T` may as well have been taken elsewhere nearby, where the submap ends.

    Of two rooms that look alike the one that was seen fits better than the next one, which was not. So the scan is
    looked for where cells count as `unseen` that the submap's scans did not see, and compared in their sight alone.
    """
    config, grid = lidar.relocation, lidar.correlative
    least = config.max_second_peak * _in_sight(scan, submap, sight, T, lidar)
    field = _opened(build_field(submap.points, grid), float(np.hypot(*scan.points.T).max()), sight, lidar)
    side_m = 2.0 * RIVAL_M / TILES
    window = SearchWindow(0.5 * side_m, RIVAL_RAD, np.zeros((3, 3)), np.inf)
    for row, column in product(range(TILES), repeat=2):
        middle = side_m * (np.array([row, column]) - 0.5 * (TILES - 1))
        guess = Pose2(T.x + middle[0], T.y + middle[1], T.theta)
        peak = search(scan.points, field, guess, window, any_heading(config, grid))
        if peak.score < RIVAL_SCORE:
            continue
        rival = icp(scan, submap, peak.pose, RIVAL_INFORMATION, lidar.icp).T_target_scan
        if rival.distance(T) > grid.peak_apart_m and _in_sight(scan, submap, sight, rival, lidar) >= least:
            return True
    return False


def _in_sight(scan: ScanPoints, submap: PointIndex, sight: Sight, T: Pose2, lidar: LidarConfig) -> float:
    """How well a scan fits among what the submap's scans saw; 0 where that is too little, or it looks through walls."""
    if seen_through_share(scan, submap.points, T, lidar.visibility) > lidar.relocation.max_seen_through:
        return 0.0
    ratio = inlier_ratio(scan, submap, T, lidar.icp)
    if ratio < RIVAL_OVERLAP:
        return 0.0
    return fit_in_sight(ratio, scan, T, sight.scans, sight.poses, lidar.visibility)


def _peak(scan: ScanPoints, field: LikelihoodField, guess: Pose2, lidar: LidarConfig) -> Peak:
    config = lidar.relocation
    window = SearchWindow(config.window_m, config.window_rad, np.zeros((3, 3)), np.inf)
    return search(scan.points, field, guess, window, any_heading(config, lidar.correlative))


def _opened(field: LikelihoodField, around_m: float, sight: Sight, lidar: LidarConfig) -> LikelihoodField:
    """The field and `around_m` beyond it, where cells that were not seen are as likely as `unseen`."""
    pad = math.ceil(around_m / field.cell_m)
    fine = np.pad(field.fine, pad)
    origin = field.origin - pad * field.cell_m
    rows, columns = (np.arange(0, n, COARSER) for n in fine.shape)
    at = np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1).reshape(-1, 2) + 0.5 * COARSER
    seen = _seen(at * field.cell_m + origin, sight, lidar.visibility).reshape(len(rows), len(columns))
    near = np.kron(seen, np.ones((COARSER, COARSER), np.bool_))[: fine.shape[0], : fine.shape[1]]
    fine = np.where(near, fine, np.maximum(fine, np.float32(lidar.relocation.unseen)))
    return LikelihoodField(fine, max_pooled(fine), origin, field.cell_m)


def _seen(points: Floats, sight: Sight, config: VisibilityConfig) -> NDArray[np.bool_]:
    """(n,) whether any scan passes or meets a point."""
    seen = np.zeros(len(points), np.bool_)
    for scan, pose in zip(sight.scans, sight.poses, strict=True):
        view = in_view(scan, Pose2.of(pose), points, config)
        seen |= view.passed | view.met
    return seen
