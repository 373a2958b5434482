"""From a loop candidate to a verdict: a bounded check by scan matching, and the gate against the estimate."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.health import position_sigma
from wayfi.backend.pose2 import Floats, Pose2, between_all, diagonal_covariance
from wayfi.frontends.closures.closure_config import ClosureConfig
from wayfi.frontends.lidar.correlative import BLUR_SIGMAS, SearchWindow, build_field, search
from wayfi.frontends.lidar.icp import IcpResult, icp
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.point_index import PointIndex
from wayfi.frontends.lidar.relocation import Sight, any_heading, has_rival
from wayfi.frontends.lidar.scan_matching import match_covariance, merge_submap
from wayfi.frontends.lidar.visibility import VisibilityConfig, agreement, seen_through_share
from wayfi.frontends.scan_points import ScanPoints

RIVAL = "another place that is not mapped may look the same, and the estimate does not tell them apart"
OPEN_ALONG = "the walls leave the pose open along them"
MIN_SCORE = 1e-9  # of the best pose: keeps the ratio finite where nothing scores


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """The pose of b in a that the estimate predicts, with its (3, 3) covariance in a's axes, m and rad."""

    T_a_b: Pose2
    covariance: Floats


@dataclass(frozen=True, slots=True, eq=False)
class CheckResult:
    """T_a_b as a check measured it, its (3, 3) covariance in a's axes, and why it is `refused` ("" if it is not).

    `second_peak` is the score of the best pose elsewhere over the best score; `submap` (n, 2) m is in a. `walls_agree`:
    refused only since walls leave the pose open along them; across them and in heading it agrees with the estimate.
    """

    T_a_b: Pose2
    covariance: Floats
    inlier_ratio: float
    residual_m: float
    second_peak: float
    submap: Floats
    refused: str
    walls_agree: bool = False


def nearest_candidate(
    keyframe: int, poses: Floats, paths: Floats, has_scan: NDArray[np.bool_], config: ClosureConfig
) -> int | None:
    """The keyframe with a scan nearest to `keyframe` in the estimate `poses` (n, 3), `min_path_m` or more before it."""
    last = int(np.searchsorted(paths, paths[keyframe] - config.min_path_m))
    earlier = np.flatnonzero(has_scan[:last])
    if len(earlier) == 0:
        return None
    distance = np.hypot(*(poses[earlier, :2] - poses[keyframe, :2]).T)
    turned = np.abs(between_all(poses[keyframe], poses[earlier])[:, 2])
    cost = distance + config.turn_cost_m_per_rad * turned
    best = int(np.argmin(cost))
    return int(earlier[best]) if distance[best] <= config.radius_m else None


def check(
    scan: ScanPoints,
    submap_scans: list[ScanPoints],
    submap_poses: Floats,
    expected: Expected,
    config: ClosureConfig,
    lidar: LidarConfig,
) -> CheckResult | None:
    """Search `scan` of b in the submap of a around the `expected` pose, refine it by ICP, and gate the result.

    The submap is `submap_scans` at `submap_poses` (n, 3) in a. None where it is empty, or the scan nearly so.
    """
    submap = merge_submap(submap_scans, submap_poses, lidar.cell_m)
    if submap is None or len(scan.points) < lidar.min_points:
        return None
    turned = math.sqrt(expected.covariance[2, 2]) > config.max_window_rad
    widest_rad = math.pi if turned else config.max_window_rad
    grid = any_heading(lidar.relocation, lidar.correlative) if turned else lidar.correlative
    smallest, largest = (config.min_window_m, config.min_window_rad), (config.max_window_m, widest_rad)
    window = SearchWindow.of(expected.covariance, config.gate_chi2, smallest, largest)
    peak = search(scan.points, build_field(submap.points, lidar.correlative), expected.T_a_b, window, grid)
    result = icp(scan, submap, peak.pose, np.zeros((3, 3)), lidar.icp)
    covariance = match_covariance(result, lidar.degenerate_below, lidar.sigma_floor_m, lidar.sigma_floor_rad)
    covariance = covariance + diagonal_covariance(config.sigma_floor_m, config.sigma_floor_rad)
    second_peak = peak.second_score / max(peak.score, MIN_SCORE)
    # beyond the field's blur around the peak, ICP has found another place
    left_peak = peak.pose.distance(result.T_target_scan) > BLUR_SIGMAS * lidar.correlative.blur_m
    free = _refused_free_choice(result, scan, submap.points, lidar) if turned else ""
    unfit = (
        free
        or _refused_inliers(result, scan, submap_scans, submap_poses, expected, config, lidar.visibility)
        or _refused_fit(covariance, second_peak, config)
    )
    if unfit == OPEN_ALONG:
        covariance = _opened(covariance, config.open_sigma_m)
    refused = (
        unfit
        or ("ICP left the peak that the search found" if left_peak else "")
        or _refused_pose(expected, result.T_target_scan, covariance, config)
        or _refused_rival(scan, submap, Sight(submap_scans, submap_poses), expected, result, config, lidar)
    )
    walls_agree = unfit == OPEN_ALONG and not _refused_pose(expected, result.T_target_scan, covariance, config)
    return CheckResult(
        result.T_target_scan, covariance, result.inlier_ratio, result.residual_m, second_peak, submap.points, refused,
        walls_agree,
    )  # fmt: skip


def _opened(covariance: Floats, sigma_m: float) -> Floats:
    """A (3, 3) covariance with another `sigma_m` along its worst direction: what was found along it says nothing."""
    along = np.linalg.eigh(covariance[:2, :2])[1][:, 1]
    opened = covariance.copy()
    opened[:2, :2] += sigma_m**2 * np.outer(along, along)
    return opened


def _refused_free_choice(result: IcpResult, scan: ScanPoints, submap: Floats, lidar: LidarConfig) -> str:
    """Why a pose of any heading is not believed, which asks for more than one that the estimate nearly knows."""
    least, most = lidar.relocation.min_inlier_ratio, lidar.relocation.max_seen_through
    if result.inlier_ratio < least:
        return f"inlier ratio {result.inlier_ratio:.2f} under {least}, for the heading is unknown"
    through = seen_through_share(scan, submap, result.T_target_scan, lidar.visibility)
    return f"looks through {through:.2f} of the walls in view, over {most}" if through > most else ""


def _refused_inliers(
    result: IcpResult,
    scan: ScanPoints,
    submap_scans: list[ScanPoints],
    submap_poses: Floats,
    expected: Expected,
    config: ClosureConfig,
    visibility: VisibilityConfig,
) -> str:
    """Why too few points fit; empty if enough do, of all or of those that the submap's scans could see."""
    ratio, overlap = result.inlier_ratio, config.overlap
    if ratio >= config.min_inlier_ratio:
        return ""
    few = f"inlier ratio {ratio:.2f} under {config.min_inlier_ratio}"
    if ratio < overlap.min_inlier_ratio or position_sigma(expected.covariance) > overlap.max_expected_sigma_m:
        return few
    agree = agreement(ratio, scan, result.T_target_scan, submap_scans, submap_poses, visibility)
    return (
        f"{few}; of those in sight {agree:.2f} under {overlap.min_agreement}" if agree < overlap.min_agreement else ""
    )


def _refused_fit(covariance: Floats, second_peak: float, config: ClosureConfig) -> str:
    """Why the two scans do not fix a pose; empty if they do."""
    if position_sigma(covariance) > config.max_sigma_m:
        return OPEN_ALONG
    if second_peak > config.max_second_peak:
        return f"ambiguous: second peak {second_peak:.2f} of the best"
    return ""


def _refused_pose(expected: Expected, T_a_b: Pose2, covariance: Floats, config: ClosureConfig) -> str:
    """Why the measured pose contradicts the estimate; empty if it does not."""
    chi2 = innovation_chi2(expected, T_a_b, covariance)
    return f"contradicts the estimate: chi2 {chi2:.1f} over {config.gate_chi2}" if chi2 > config.gate_chi2 else ""


def _refused_rival(
    scan: ScanPoints,
    submap: PointIndex,
    sight: Sight,
    expected: Expected,
    result: IcpResult,
    config: ClosureConfig,
    lidar: LidarConfig,
) -> str:
    """Why a scan that fits may be from elsewhere, where the estimate allows more than the window that was searched."""
    wide = config.gate_chi2**0.5 * position_sigma(expected.covariance) > config.max_window_m
    return RIVAL if wide and has_rival(scan, submap, sight, result.T_target_scan, lidar) else ""


def update_by_place(expected: Expected, place_a: Floats, place_b: Floats, sigma_m: float) -> tuple[Expected, float]:
    """Kalman update of the expected T_a_b by the measurement that two places are one.

    `place_a` (2,) m in a and `place_b` (2,) m in b are one place, to `sigma_m` along each axis. Also returns the chi2
    (2 degrees of freedom) of the measurement against what was expected before.
    """
    T = expected.T_a_b
    turned = Pose2(0.0, 0.0, T.theta).transform(place_b[None])[0]
    J = np.array([[1.0, 0.0, -turned[1]], [0.0, 1.0, turned[0]]])
    apart = place_a - turned - (T.x, T.y)
    C = expected.covariance
    S = J @ C @ J.T + sigma_m**2 * np.eye(2)
    gain = C @ J.T @ np.linalg.inv(S)
    covariance = C - gain @ J @ C
    nearer = Expected(Pose2.of(T.array() + gain @ apart), 0.5 * (covariance + covariance.T))
    return nearer, float(apart @ np.linalg.solve(S, apart))


def innovation_chi2(expected: Expected, measured: Pose2, covariance: Floats) -> float:
    """Squared Mahalanobis distance of `measured` T_a_b, of (3, 3) `covariance` in a's axes, from what is expected."""
    e = expected.T_a_b.error_of(measured)
    return float(e @ np.linalg.solve(expected.covariance + covariance, e))
