"""Scan matching: each keyframe's scan against a submap of the ones before it, and submaps to check closures against."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, diagonal_covariance
from wayfi.frontends.lidar.correlative import SearchWindow, build_field, search
from wayfi.frontends.lidar.icp import IcpResult, icp
from wayfi.frontends.lidar.laser_points import transform_scans
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.point_index import PointIndex, build_index
from wayfi.frontends.lidar.visibility import fit_in_sight
from wayfi.frontends.scan_points import ScanPoints

# Added to a scan's information, so that a direction it does not constrain has a sigma of 1 m or 1 rad: 70 times what
# the wheels leave open over half a metre, so that they decide there, and the matrix can still be inverted.
OPEN = np.eye(3)


@dataclass(frozen=True, slots=True, eq=False)
class ScanMatch:
    """A scan's pose in the submap's frame, its (3, 3) covariance in that frame's axes, and how well it fits."""

    T_submap_scan: Pose2
    covariance: Floats
    inlier_ratio: float
    residual_m: float


class SubmapRays(NamedTuple):
    """The scans that a submap is made of, whose rays tell where there is nothing, at (n, 3) `poses` in its frame.

    `protect`: they protect every guess from what fits by chance, not only one along walls that leave it nearly open.
    """

    scans: list[ScanPoints]
    poses: Floats
    protect: bool


def merge_submap(scans: list[ScanPoints], poses: Floats, cell_m: float) -> PointIndex | None:
    """The index of several scans at (n, 3) poses in the submap's frame; None if they hold no points."""
    if sum(len(scan.points) for scan in scans) == 0:
        return None
    lengths = np.array([len(scan.points) for scan in scans])
    points = np.concatenate([scan.points for scan in scans])
    normals = np.concatenate([scan.normals for scan in scans])
    return build_index(*transform_scans(points, normals, lengths, poses), cell_m)


def match_scan(
    scan: ScanPoints,
    submap: PointIndex,
    guess: Pose2,
    guess_covariance: Floats,
    search_below: float,
    config: LidarConfig,
    rays: SubmapRays | None,
) -> ScanMatch:
    """Match `scan` to `submap` from `guess`.

    Where that leaves an inlier ratio under `search_below`, the window of `guess_covariance` is searched as well. What
    is found there must fit better, with `rays` also among the points that they could see.
    """
    prior = np.asarray(np.linalg.inv(guess_covariance), np.float64)
    result = icp(scan, submap, guess, prior, config.icp)
    T = without_prior(result, guess, prior, config)
    if result.inlier_ratio < search_below:
        found = _search_and_match(scan, submap, guess, guess_covariance, config)
        if _fits_better(scan, found, result, rays, config):
            result, T = found, found.T_target_scan
    return as_match(result, T, config)


def _fits_better(
    scan: ScanPoints, found: IcpResult, result: IcpResult, rays: SubmapRays | None, config: LidarConfig
) -> bool:
    """Whether a pose `found` fits clearly better than the `result` does, also among the points in sight of the submap.

    In a bare corridor a scan that is moved back has more inliers, since its far end then lies on walls seen before; but
    all that is in sight fits the pose ahead as well, whose far end has not been seen yet. Where walls fix the pose in
    every direction, the guess of poor wheels needs no such protection: inliers alone decide.
    """
    if found.inlier_ratio <= result.inlier_ratio + config.search.min_gain:
        return False
    if rays is None or not (rays.protect or nearly_open(found.information, config)):
        return True
    before, after = (
        fit_in_sight(r.inlier_ratio, scan, r.T_target_scan, rays.scans, rays.poses, config.visibility)
        for r in (result, found)
    )
    return after > before + config.search.min_gain


def nearly_open(information: Floats, config: LidarConfig) -> bool:
    """Whether the points tell far less along one direction than across it, as in a corridor."""
    along, across = np.linalg.eigvalsh(information[:2, :2])
    return bool(along < config.search.nearly_open * across)


def as_match(result: IcpResult, T: Pose2, config: LidarConfig) -> ScanMatch:
    """The match at `T` that an ICP `result` led to."""
    covariance = match_covariance(result, config.degenerate_below, config.sigma_floor_m, config.sigma_floor_rad)
    return ScanMatch(T, covariance, result.inlier_ratio, result.residual_m)


def without_prior(result: IcpResult, guess: Pose2, prior: Floats, config: LidarConfig) -> Pose2:
    """The pose z by the scan alone, of a `result` x that `prior` (3, 3) information P about `guess` has drawn to it.

    The graph has the wheels as a factor of their own, and must not count them twice. With the scan's information I,
    x solves P (x - guess) + I (x - z) = 0; along a direction that the scan does not constrain, z stays at x.
    """
    x = result.T_target_scan
    off = guess.error_of(x)
    kept = constrained_directions(result.information, config.degenerate_below)
    information = kept @ result.information @ kept + OPEN
    return Pose2.of(x.array() + np.linalg.solve(information, kept @ prior @ off))


def match_covariance(
    result: IcpResult, degenerate_below: float, sigma_floor_m: float, sigma_floor_rad: float
) -> Floats:
    """(3, 3) covariance of an ICP from its Hessian: 1 m or 1 rad along open directions, and the floor on top.

    In a corridor the noise of the normals feigns a little information along it; a direction with less than
    `degenerate_below` of the other's is taken to have none (after X-ICP, Tuna et al., arXiv 2211.16335).
    """
    kept = constrained_directions(result.information, degenerate_below)
    floor = diagonal_covariance(sigma_floor_m, sigma_floor_rad)
    covariance = np.linalg.inv(kept @ result.information @ kept + OPEN) + floor
    return 0.5 * (covariance + covariance.T)


def constrained_directions(information: Floats, degenerate_below: float) -> Floats:
    """(3, 3) projection onto the directions that the points constrain; see `match_covariance`."""
    eigenvalues, directions = np.linalg.eigh(information[:2, :2])
    kept = np.eye(3)
    if eigenvalues[0] < degenerate_below * eigenvalues[1]:
        kept[:2, :2] = np.outer(directions[:, 1], directions[:, 1])
    return kept


def _search_and_match(
    scan: ScanPoints, submap: PointIndex, guess: Pose2, covariance: Floats, config: LidarConfig
) -> IcpResult:
    bounds = config.search
    smallest, largest = (bounds.min_window_m, bounds.min_window_rad), (bounds.max_window_m, bounds.max_window_rad)
    window = SearchWindow.of(covariance, bounds.chi2, smallest, largest)
    peak = search(scan.points, build_field(submap.points, config.correlative), guess, window, config.correlative)
    return icp(scan, submap, peak.pose, np.zeros((3, 3)), config.icp)
