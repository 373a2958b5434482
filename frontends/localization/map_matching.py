"""A scan against the map: where it fits around an expected pose, how well, and whether it contradicts the map."""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, covariance_in_b, diagonal_covariance
from wayfi.frontends.lidar.correlative import SearchWindow, search
from wayfi.frontends.lidar.icp import IcpResult, icp
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.scan_matching import constrained_directions
from wayfi.frontends.lidar.visibility import fit_in_sight, seen_through_share
from wayfi.frontends.localization.localization_config import FixConfig
from wayfi.frontends.localization.map_places import Place
from wayfi.frontends.scan_points import ScanPoints

LOOSE = 1e-4 * np.eye(3)  # information of a sigma of 100 m and 100 rad: a direction that the walls leave open
AMBIGUOUS_M = 3.0  # sigma of a pose that is one of several in the window searched
FURNITURE = 0.1  # of the walls in view: what is moved between two days, and says nothing against a pose


class Agreement(Enum):
    """What a scan says of the pose at which it was expected."""

    AGREES = "it fits the map there"
    APART = "it fits the map, but not where the way so far puts it"
    SILENT = "none of them"
    CONTRADICTS = "it fits nowhere near, or looks through the map's walls"


@dataclass(frozen=True, slots=True, eq=False)
class Fix:
    """A scan's pose in `map` with its (3, 3) covariance there, wide along directions that the walls leave open.

    `fit`: of the points in sight of the map's scans, the share that fits; `seen_through`: of the map's walls in view,
    the share that the scan's rays pass. `quality` is 1 where every point in sight lies on its wall.
    """

    T_map_base: Pose2
    covariance: Floats
    fit: float
    seen_through: float
    quality: float
    agreement: Agreement


class MapMatcher:
    """Matches scans with places of the map."""

    def __init__(self, lidar: LidarConfig, config: FixConfig) -> None:
        self._lidar, self._config = lidar, config

    def fix(self, scan: ScanPoints, place: Place, expected: Pose2, covariance: Floats) -> Fix:
        """Match `scan`, `expected` in `map` with (3, 3) `covariance` there, with a place near."""
        T_place_expected = place.T_map_place.between(expected)
        theta = place.T_map_place.theta
        around = covariance_in_b(covariance, theta)
        result, alone = self._match(scan, place, T_place_expected, around)
        fix = self.as_fix(scan, place, result)
        if not alone and np.linalg.eigvalsh(fix.covariance[:2, :2])[-1] < AMBIGUOUS_M**2:
            fix = replace(fix, covariance=fix.covariance + np.diag([AMBIGUOUS_M**2, AMBIGUOUS_M**2, 0.0]))
        e = expected.error_of(fix.T_map_base)
        chi2 = float(e @ np.linalg.solve(covariance + fix.covariance, e))
        if fix.agreement is Agreement.AGREES and chi2 > self._config.chi2:
            return replace(fix, agreement=Agreement.APART)
        return fix

    def as_fix(self, scan: ScanPoints, place: Place, result: IcpResult) -> Fix:
        """The fix of an ICP `result` in a place."""
        T = result.T_target_scan
        fit = fit_in_sight(result.inlier_ratio, scan, T, list(place.scans), place.poses, self._lidar.visibility)
        through = seen_through_share(scan, place.walls.points, T, self._lidar.visibility)
        covariance = covariance_in_b(self._covariance(result), -place.T_map_place.theta)
        lies = 1.0 - result.residual_m / self._lidar.icp.inlier_m
        quality = fit * lies - max(through - FURNITURE, 0.0)
        return Fix(place.T_map_place @ T, covariance, fit, through, quality, self._judge(fit, through))

    def _judge(self, fit: float, through: float) -> Agreement:
        config = self._config
        if fit >= config.min_fit and through <= config.max_seen_through:
            return Agreement.AGREES
        if fit < config.least_fit or through > config.most_seen_through:
            return Agreement.CONTRADICTS
        return Agreement.SILENT

    def _match(self, scan: ScanPoints, place: Place, expected: Pose2, covariance: Floats) -> tuple[IcpResult, bool]:
        """The scan's pose around the expected one, and whether no other one there fits nearly as well."""
        config, no_prior = self._config, np.zeros((3, 3))
        sigma_m = float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
        if sigma_m <= config.search_above_m and covariance[2, 2] <= config.search_above_rad**2:
            return icp(scan, place.walls, expected, no_prior, self._lidar.icp), True
        smallest = (config.min_window_m, config.min_window_rad)
        largest = (config.max_window_m, config.max_window_rad)
        window = SearchWindow.of(covariance, config.chi2, smallest, largest)
        peak = search(scan.points, place.field, expected, window, self._lidar.correlative)
        alone = peak.second_score <= self._lidar.relocation.max_second_peak * peak.score
        return icp(scan, place.walls, peak.pose, no_prior, self._lidar.icp), alone

    def _covariance(self, result: IcpResult) -> Floats:
        """(3, 3) covariance of a result in the axes of its place."""
        kept = constrained_directions(result.information, self._lidar.degenerate_below)
        floor = diagonal_covariance(self._config.sigma_floor_m, self._config.sigma_floor_rad)
        return np.asarray(np.linalg.inv(kept @ result.information @ kept + LOOSE) + floor)
