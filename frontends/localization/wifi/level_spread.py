"""How much RSSI differs between places of a map: learnt from its fingerprints, pair by pair.

Readings of two fingerprints differ by sqrt(2) times what one reading does at a place, and the more the further apart
they are. The offset of a receiver cancels: of each pair the differences are taken about their median.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.lidar.point_index import CellGrid, block_around, sort_by_cell
from wayfi.frontends.localization.wifi.belief_config import LikelihoodConfig
from wayfi.frontends.localization.wifi.heard import Heard

NEAR_M, FAR_M, MOST_M = 1.5, 2.0, 6.0  # apart: a pair at one place, and pairs that tell the growth
EXAMINED = 200  # fingerprints, evenly drawn: bounds the cost
LEAST_PAIRS = 30  # with fewer at one place, a map does not tell its spread
LEAST_COMMON = 5  # access points of a pair
MAD = 1.4826  # sigma of a normal distribution over its median absolute deviation


class LevelSpread(NamedTuple):
    """The sigma (dB) of RSSI about that of the map at a place, and its growth (dB/m) away from there."""

    level_db: float
    gradient_db_per_m: float

    def at(self, distance_m: Floats) -> Floats:
        """(n,) sigma, dB, at `distance_m` (n,) from a place."""
        return np.hypot(self.level_db, self.gradient_db_per_m * distance_m)


def learn_spread(at: Floats, heard: Heard, config: LikelihoodConfig) -> LevelSpread:
    """The spread of fingerprints, which were heard `at` (n, 2) m; that of `config` where too few are near each other.

    What changes from day to day no map of one day tells: it is added.
    """
    order, cells = sort_by_cell(at, MOST_M)
    examined = np.arange(0, len(at), max(1, len(at) // EXAMINED))
    distance_m, sigma_db = _pairs(at, at[order], order, cells, heard, examined, int(heard.aps.max(initial=-1)) + 1)
    near, far = distance_m < NEAR_M, distance_m >= FAR_M
    if min(np.count_nonzero(near), np.count_nonzero(far)) < LEAST_PAIRS:
        return LevelSpread(config.level_db, config.gradient_db_per_m)
    once_db = float(np.median(sigma_db[near])) / math.sqrt(2.0)
    growth = np.sqrt(np.maximum(sigma_db[far] ** 2 - 2.0 * once_db**2, 0.0)) / distance_m[far]
    return LevelSpread(math.hypot(once_db, config.day_db), float(np.median(growth)))


@njit(cache=True)
def _pairs(
    at: Floats,
    sorted_at: Floats,
    order: NDArray[np.int64],
    cells: CellGrid,
    heard: Heard,
    examined: NDArray[np.int64],
    access_points: int,
) -> tuple[Floats, Floats]:
    """The distance (m) of each of the `examined` to each fingerprint around, and the sigma (dB) of their difference."""
    level = np.full(access_points, np.nan)
    distances, sigmas = [0.0 for _ in range(0)], [0.0 for _ in range(0)]
    difference = np.empty(access_points)
    for f in examined:
        own = heard.aps[heard.starts[f] : heard.starts[f + 1]]
        level[own] = heard.rssi[heard.starts[f] : heard.starts[f + 1]]
        top, bottom, left, right = block_around(at[f, 0], at[f, 1], cells)
        for r in range(top, bottom):
            for k in range(cells.starts[r * cells.columns + left], cells.starts[r * cells.columns + right]):
                apart_m = math.hypot(sorted_at[k, 0] - at[f, 0], sorted_at[k, 1] - at[f, 1])
                common = 0
                for i in range(heard.starts[order[k]], heard.starts[order[k] + 1]):
                    if not math.isnan(level[heard.aps[i]]):
                        difference[common] = heard.rssi[i] - level[heard.aps[i]]
                        common += 1
                if order[k] != f and apart_m < MOST_M and common >= LEAST_COMMON:
                    d = difference[:common]
                    distances.append(apart_m)
                    sigmas.append(MAD * np.median(np.abs(d - np.median(d))))
        level[own] = np.nan
    return np.array(distances), np.array(sigmas)
