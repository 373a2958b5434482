"""In which direction each access point stands, seen from the places of a map: that of its likely positions.

A position is as likely as the path loss from it (the log-distance model, its power and exponent fitted) explains the
levels that were heard around. What is not known of the position makes the mean direction shorter.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.localization.wifi.heard import Heard

Longs = NDArray[np.int64]

CELL_M = 4.0  # within which levels are one measurement, and directions are the same
MOST_POSITIONS = 1500  # that are tried on a floor
MARGIN_M = 40.0  # around what was driven, in which access points stand
NEAREST_M = 2.0  # from any: ceilings are as high
SHADOW_DB = 5.0  # log-normal shadowing, new in each cell
EXPONENT, EXPONENT_SIGMA = 3.2, 0.7  # of path loss indoors


@dataclass(frozen=True, slots=True, eq=False)
class Directions:
    """The mean unit vector `towards` (cells, access points, 2) each access point; fingerprints lie in `cell` (m,)."""

    cell: Longs
    towards: NDArray[np.float32]

    def seen_from(self, fingerprints: Longs, heard: Heard) -> NDArray[np.float32]:
        """(entries, 2) mean unit vectors to what was `heard` at, or near, each of these `fingerprints` (n,)."""
        return np.asarray(self.towards[self.cell[fingerprints[heard.rows()]], heard.aps])


def directions(at: Floats, floor: Longs, heard: Heard, access_points: int) -> Directions:
    """Directions by what was `heard` `at` (m, 2) m, each on a `floor` (m,); different floors lie far apart."""
    corners, cell = np.unique(np.floor(at / CELL_M), axis=0, return_inverse=True)
    cell = cell.reshape(-1)
    xy = (corners + 0.5) * CELL_M
    shape = (len(xy), access_points)
    flat = cell[heard.rows()] * access_points + heard.aps
    count = np.bincount(flat, minlength=len(xy) * access_points).reshape(shape)
    level = np.bincount(flat, heard.rssi, len(xy) * access_points).reshape(shape) / np.maximum(count, 1)
    towards = np.zeros((*shape, 2), np.float32)
    floor_of_cell = np.zeros(len(xy), np.int64)
    floor_of_cell[cell] = floor
    for number in np.unique(floor_of_cell):
        on = np.flatnonzero(floor_of_cell == number)
        positions = _positions(xy[on])
        away = positions[:, None] - xy[on]
        distance_m = np.hypot(away[..., 0], away[..., 1])
        weights = _weights(level[on], count[on] > 0, np.maximum(distance_m, NEAREST_M))
        unit = away / np.maximum(distance_m, NEAREST_M)[..., None]
        towards[on] = np.einsum("aq,qck->cak", weights, unit, optimize=True)
    return Directions(cell, towards)


def _positions(cells: Floats) -> Floats:
    """(q, 2) m that are tried, on a lattice around `cells` (c, 2) m."""
    low, high = cells.min(axis=0) - MARGIN_M, cells.max(axis=0) + MARGIN_M
    step = max(CELL_M, float(np.sqrt(np.prod(high - low) / MOST_POSITIONS)))
    axes = [np.arange(low[k], high[k] + step, step) for k in range(2)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def _weights(level: Floats, heard: NDArray[np.bool_], distance_m: Floats) -> Floats:
    """(a, q) weights, of sum 1, of positions `distance_m` (q, c) from cells of `level` (c, a) dBm where `heard`."""
    w = heard.T.astype(np.float64)
    y = np.where(heard, level, 0.0).T
    x = -10.0 * np.log10(distance_m).T
    count = np.maximum(w.sum(axis=1), 1.0)[:, None]
    sum_x, sum_y = w @ x, y.sum(axis=1)[:, None]
    xx = w @ x**2 - sum_x**2 / count
    xy = y @ x - sum_x * sum_y / count
    prior = (SHADOW_DB / EXPONENT_SIGMA) ** 2
    target = xy + prior * EXPONENT
    log = 0.5 * target**2 / (xx + prior) / SHADOW_DB**2 - 0.5 * np.log(xx + prior)
    weights = np.exp(log - log.max(axis=1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
