"""From a loop candidate to a verdict: the bounded check by scan matching, and the gate against what is known."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats, Pose2, between_all, wrap
from wayfi.frontends.consensus import ConsensusConfig
from wayfi.frontends.correlative import build_field, search
from wayfi.frontends.icp import icp
from wayfi.frontends.laser_points import ScanPoints
from wayfi.frontends.lidar import LidarConfig, match_covariance, merge_submap


@dataclass(frozen=True)
class ClosureConfig:
    """Which candidates are checked, how far the check looks, and what it takes to be believed."""

    radius_m: float = option(5.0, "m", "the paper: LiDAR closures between poses that the estimate puts this near")
    min_path_m: float = option(15.0, "m", "nearer along the path the local submap has already closed it")
    check_every_m: float = option(1.0, "m", "checks nearer to each other see the same walls")
    submap_reach: int = option(7, "keyframes", "on each side of the candidate: 7 m of path")
    max_window_m: float = option(4.0, "m", "beyond it aisles repeat; bounds the poses examined")
    max_window_rad: float = option(0.5, "rad", "as above")
    min_inlier_ratio: float = option(0.6, "", "the paper's half admits a neighbouring aisle")
    max_second_peak: float = option(0.92, "", "of the best score: nearer than this the place is ambiguous")
    gate_chi2: float = option(9.0, "", "97 % of true closures pass at 3 degrees of freedom, an aisle too far does not")
    drift: float = option(0.002, "1", "of the path: errors of scan matching that add up one way, as 0.2 % were seen to")
    drift_rad_per_m: float = option(0.0003, "rad/m", "the same of the heading: 1 degree over 60 m")
    remove_chi2: float = option(25.0, "", "an accepted closure that stays this far off is taken back")
    sigma_floor_m: float = option(0.02, "m", "submaps bend by this much over their length")
    sigma_floor_rad: float = option(0.004, "rad", "as above")
    consensus: ConsensusConfig = field(default_factory=ConsensusConfig)


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """A bounded check: where it puts b in a, its (3, 3) covariance, and why it is refused ("" if it is not)."""

    T_a_b: Pose2
    covariance: Floats
    inlier_ratio: float
    residual_m: float
    second_peak: float
    submap: Floats
    refused: str


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
    cost = distance + 0.5 * turned
    best = int(np.argmin(cost))
    return int(earlier[best]) if distance[best] <= config.radius_m else None


def check(
    scan: ScanPoints,
    submap_scans: list[ScanPoints],
    submap_poses: Floats,
    guess: Pose2,
    guess_covariance: Floats,
    config: ClosureConfig,
    lidar: LidarConfig,
) -> Check | None:
    """Search `scan` in the submap of a (scans at (n, 3) poses in its frame) around `guess` T_a_b; None if empty."""
    submap = merge_submap(submap_scans, submap_poses, lidar.cell_m)
    if submap is None or len(scan.points) < lidar.min_points:
        return None
    window_m = min(max(3 * math.sqrt(max(guess_covariance[0, 0], guess_covariance[1, 1])), 0.4), config.max_window_m)
    window_rad = min(max(3 * math.sqrt(guess_covariance[2, 2]), 0.1), config.max_window_rad)
    likelihood = build_field(submap.points, lidar.correlative)
    peak = search(scan.points, likelihood, guess, window_m, window_rad, lidar.correlative)
    result = icp(scan, submap, peak.pose, np.zeros((3, 3)), lidar.icp)
    floor = np.diag([config.sigma_floor_m**2, config.sigma_floor_m**2, config.sigma_floor_rad**2])
    covariance = match_covariance(result, lidar) + floor
    second = peak.second_score / max(peak.score, 1e-9)
    refused = ""
    if result.inlier_ratio < config.min_inlier_ratio:
        refused = f"inlier ratio {result.inlier_ratio:.2f} under {config.min_inlier_ratio}"
    elif second > config.max_second_peak:
        refused = f"ambiguous: second peak {second:.2f} of the best"
    elif peak.pose.distance(result.T_target_scan) > 3 * lidar.correlative.blur_m:
        refused = "ICP left the peak that the search found"
    return Check(
        result.T_target_scan, covariance, result.inlier_ratio, result.residual_m, second, submap.points, refused
    )


def innovation_chi2(predicted: Pose2, predicted_covariance: Floats, measured: Pose2, covariance: Floats) -> float:
    """Squared Mahalanobis distance of `measured` from `predicted` (T_a_b), their covariances (3, 3) in a's axes."""
    e = np.array([measured.x - predicted.x, measured.y - predicted.y, wrap(measured.theta - predicted.theta)])
    return float(e @ np.linalg.solve(predicted_covariance + covariance, e))
