"""Gathers particles to places: the peaks of their density, each with its covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, wrap_all

CELL_M = 2.0  # of the density whose peaks are sought
HEADINGS = 12  # bins of the circle
ONE_HEADING_RAD = 1.2  # particles turned by less from the peak have its heading
ONE_HEADING = 0.8  # of a place's weight: with less of one heading, it is not known
OPEN_RAD2 = np.pi**2 / 3  # variance of a heading that is wide open


@dataclass(frozen=True, slots=True, eq=False)
class PlaceBelief:
    """A place of the robot on a floor of the map, and the weight (0 to 1) of it.

    The (3, 3) covariance is in map; where the heading is not known its variance is pi^2 / 3, that of a whole turn.
    """

    T_map_base: Pose2
    covariance: Floats
    weight: float
    floor: int = 0

    @property
    def sigma_m(self) -> float:
        """Along the longest axis of the covariance."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))

    @property
    def sigma_rad(self) -> float:
        """Of the heading."""
        return float(np.sqrt(self.covariance[2, 2]))


def places_of(
    poses: Floats, floor: NDArray[np.int64], weights: Floats, most: int, near_m: float, floor_m: float
) -> list[PlaceBelief]:
    """The `most` heaviest places of particles `poses` (n, 3) on `floor` (n,) of `weights` (n,), the heaviest first."""
    left = weights.copy()
    found: list[PlaceBelief] = []
    while len(found) < most and left.sum() > 0.0:
        peak = _peak(poses, floor, left)
        near = (floor == floor[peak]) & (np.hypot(*(poses[:, :2] - poses[peak, :2]).T) < near_m) & (left > 0.0)
        found.append(_place(poses[near], left[near], int(floor[peak]), floor_m))
        left[near] = 0.0
    return sorted(found, key=lambda place: -place.weight)


def _peak(poses: Floats, floor: NDArray[np.int64], weights: Floats) -> int:
    """The number of a particle in the densest cell."""
    _, cell = np.unique(_cells(poses, floor), return_inverse=True)
    heaviest = int(np.argmax(np.bincount(cell, weights)))
    members = np.flatnonzero(cell == heaviest)
    middle = weights[members] @ poses[members, :2] / weights[members].sum()
    return int(members[np.argmin(np.hypot(*(poses[members, :2] - middle).T))])


def _cells(poses: Floats, floor: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) a number for the cell of each of `poses` (n, 3): they grow along x, then y, then by the floor."""
    cells = np.column_stack([np.floor(poses[:, :2] / CELL_M).astype(np.int64), floor])
    cells -= cells.min(axis=0)
    _, columns, floors = (cells.max(axis=0) + 1).tolist()
    return np.asarray((cells[:, 0] * columns + cells[:, 1]) * floors + cells[:, 2])


def _place(poses: Floats, weights: Floats, floor: int, floor_m: float) -> PlaceBelief:
    """One place of particles near each other."""
    weight = float(weights.sum())
    heading = _heading(poses[:, 2], weights)
    turned = wrap_all(poses[:, 2] - heading)
    kept = np.abs(turned) < ONE_HEADING_RAD
    if weights[kept].sum() >= ONE_HEADING * weight:
        error = np.column_stack([poses[:, :2], turned])[kept]
        share = weights[kept] / weights[kept].sum()
        mean = share @ error
        covariance = (share[:, None] * (error - mean)).T @ (error - mean)
        pose = Pose2.of((mean[0], mean[1], heading + mean[2]))
    else:
        share = weights / weight
        mean = share @ poses[:, :2]
        covariance = np.zeros((3, 3))
        covariance[:2, :2] = (share[:, None] * (poses[:, :2] - mean)).T @ (poses[:, :2] - mean)
        covariance[2, 2] = OPEN_RAD2
        pose = Pose2(float(mean[0]), float(mean[1]), heading)
    return PlaceBelief(pose, covariance + np.diag([floor_m**2, floor_m**2, 1e-3]), weight, floor)


def _heading(headings: Floats, weights: Floats) -> float:
    """The mean heading of the densest part of the circle."""
    bins = np.floor((headings + np.pi) * HEADINGS / (2 * np.pi)).astype(np.int64) % HEADINGS
    density = np.bincount(bins, weights, minlength=HEADINGS)
    smooth = density + np.roll(density, 1) + np.roll(density, -1)
    middle = (int(np.argmax(smooth)) + 0.5) * 2 * np.pi / HEADINGS - np.pi
    near = np.abs(wrap_all(headings - middle)) < ONE_HEADING_RAD
    return float(middle + np.average(wrap_all(headings[near] - middle), weights=weights[near]))
