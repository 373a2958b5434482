"""Scan matching: each keyframe's scan against a submap of the ones before it, and submaps to check closures against."""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.lidar.correlative import SearchWindow, build_field, search
from wayfi.frontends.lidar.icp import IcpResult, icp
from wayfi.frontends.lidar.laser_points import place_all
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.point_index import PointIndex, build_index
from wayfi.frontends.scan_points import ScanPoints

OPEN = np.eye(3)  # information, 1 / m^2 and 1 / rad^2, about what a scan does not see
SEARCHED_CHI2 = 9.0  # 97 % of what wheels err by at 3 degrees of freedom, if they are as good as they say
LEAST_WINDOW = (0.3, 0.3)  # m, rad: wheels that slip are further off than they say
MOST_WINDOW = (1.0, 1.0)  # m, rad: twice what keyframes stand apart; bounds the cost
BETTER_RATIO = 0.05  # by which what the search finds must fit better than what lies at the guess


@dataclass(frozen=True, slots=True, eq=False)
class ScanMatch:
    """A scan's pose in the submap's frame, with the (3, 3) covariance in that frame's axes, and how well it fits."""

    T_submap_scan: Pose2
    covariance: Floats
    inlier_ratio: float
    residual_m: float


def merge_submap(scans: list[ScanPoints], poses: Floats, cell_m: float) -> PointIndex | None:
    """The index of several scans at (n, 3) poses in the submap's frame; None if they hold no points."""
    if sum(len(scan.points) for scan in scans) == 0:
        return None
    lengths = np.array([len(scan.points) for scan in scans])
    points = np.concatenate([scan.points for scan in scans])
    normals = np.concatenate([scan.normals for scan in scans])
    return build_index(*place_all(points, normals, lengths, poses), cell_m)


def match_scan(
    scan: ScanPoints,
    submap: PointIndex,
    guess: Pose2,
    guess_covariance: Floats,
    search_below: float,
    config: LidarConfig,
) -> ScanMatch:
    """Match `scan` to `submap` from `guess`.

    Where that leaves an inlier ratio under `search_below`, the window of `guess_covariance` is searched as well.
    """
    prior = np.asarray(np.linalg.inv(guess_covariance), np.float64)
    result = icp(scan, submap, guess, prior, config.icp)
    T = without_prior(result, guess, prior, config)
    if result.inlier_ratio < search_below:
        found = _search_and_match(scan, submap, guess, guess_covariance, config)
        if found.inlier_ratio > result.inlier_ratio + BETTER_RATIO:
            result, T = found, found.T_target_scan
    return ScanMatch(T, match_covariance(result, config), result.inlier_ratio, result.residual_m)


def without_prior(result: IcpResult, guess: Pose2, prior: Floats, config: LidarConfig) -> Pose2:
    """What the scan alone says, where `result` leant on `prior` (3, 3) information about `guess` as well.

    The graph counts the wheels itself. From P (x - guess) + I (x - z) = 0 at the pose x that was found; where the scan
    sees nothing, z stays at x.
    """
    x = result.T_target_scan
    off = np.array([x.x - guess.x, x.y - guess.y, wrap(x.theta - guess.theta)])
    kept = seen_directions(result.information, config.degenerate_below)
    information = kept @ result.information @ kept + OPEN
    return Pose2.of(x.array() + np.linalg.solve(information, kept @ prior @ off))


def match_covariance(result: IcpResult, config: LidarConfig) -> Floats:
    """(3, 3) covariance of an ICP: what its Hessian does not see stays open (1 m, 1 rad), and a floor holds below.

    In a corridor the noise of the normals feigns a little information along it; a direction with less than
    `degenerate_below` of the other's is taken to have none (after X-ICP, Tuna et al., arXiv 2211.16335).
    """
    floor = np.diag([config.sigma_floor_m**2, config.sigma_floor_m**2, config.sigma_floor_rad**2])
    kept = seen_directions(result.information, config.degenerate_below)
    covariance = np.linalg.inv(kept @ result.information @ kept + OPEN) + floor
    return 0.5 * (covariance + covariance.T)


def seen_directions(information: Floats, degenerate_below: float) -> Floats:
    """(3, 3) projection that leaves out a direction of translation that is not really seen."""
    eigenvalues, directions = np.linalg.eigh(information[:2, :2])
    kept = np.eye(3)
    if eigenvalues[0] < degenerate_below * eigenvalues[1]:
        kept[:2, :2] = np.outer(directions[:, 1], directions[:, 1])
    return kept


def _search_and_match(
    scan: ScanPoints, submap: PointIndex, guess: Pose2, covariance: Floats, config: LidarConfig
) -> IcpResult:
    window = SearchWindow.of(covariance, SEARCHED_CHI2, LEAST_WINDOW, MOST_WINDOW)
    peak = search(scan.points, build_field(submap.points, config.correlative), guess, window, config.correlative)
    return icp(scan, submap, peak.pose, np.zeros((3, 3)), config.icp)
