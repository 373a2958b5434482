"""How far off the ways of a map the levels of WiFi say that a robot is.

Away from all fingerprints, some place of the map still fits best, and is named. But the levels there differ from the
map's by more than at a place: by as much as places differ that are so far apart.
"""

import math
from typing import NamedTuple

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.localization.wifi.belief_config import LikelihoodConfig
from wayfi.frontends.localization.wifi.clusters import PlaceBelief
from wayfi.frontends.localization.wifi.directivity import NO_GAIN, Gain, facing
from wayfi.frontends.localization.wifi.radio_places import RadioPlaces
from wayfi.frontends.wifi.readings import Readings

DISTANCES_M = np.arange(0.0, 12.1, 0.5)  # that are told apart
NEWEST = 0.25  # of the mean: that of the last four scans
LEAST_COMMON = 5  # access points, by which a scan is compared
ROOT_2PI = math.sqrt(2.0 * math.pi)


class Away(NamedTuple):
    """The distance (m) of the robot from the map's places by levels, and that of the place which WiFi names."""

    by_levels_m: float = 0.0
    named_m: float = 0.0

    @property
    def metres(self) -> float:
        """By the one or the other: in which direction, WiFi does not tell."""
        return max(self.by_levels_m, self.named_m)

    @property
    def unexplained_m(self) -> float:
        """How far the robot is from the place that is named, if levels are right."""
        return math.sqrt(max(self.by_levels_m**2 - self.named_m**2, 0.0))


class OffWays:
    """The likelihood of each distance from the map's places, by the last scans where WiFi named one."""

    def __init__(self, places: RadioPlaces, config: LikelihoodConfig) -> None:
        self._places, self._config = places, config
        self._sigma_db = places.fingerprinted.spread.at(DISTANCES_M)[:, None]
        self._log_likelihood = np.zeros(len(DISTANCES_M))
        self._named_m = 0.0

    def add(self, readings: Readings, named: PlaceBelief, gain: Gain = NO_GAIN) -> None:
        """Use a scan of a receiver of some `gain`, after which WiFi has `named` the place where it was taken."""
        xy, floor = np.array([[named.T_map_base.x, named.T_map_base.y]]), np.array([named.floor])
        number, distance_m = self._places.nearest(xy, floor)
        more_db = facing(gain, np.array([named.T_map_base.theta]))[0]
        difference_db = _differences(self._places, int(number[0]), readings, more_db)
        if not np.isfinite(distance_m[0]) or len(difference_db) < LEAST_COMMON:
            return
        self._named_m = float(distance_m[0])
        d = (difference_db - np.median(difference_db)) / self._sigma_db
        density = np.exp(-0.5 * d * d) / (self._sigma_db * ROOT_2PI)
        changed = self._config.changed
        each = np.log((1.0 - changed) * density + changed / self._config.range_db).sum(axis=1)
        self._log_likelihood += NEWEST * (each - self._log_likelihood)

    @property
    def away(self) -> Away:
        """As it is by the scans so far."""
        return Away(float(DISTANCES_M[np.argmax(self._log_likelihood)]), self._named_m)


def _differences(places: RadioPlaces, place: int, readings: Readings, more_db: Floats) -> Floats:
    """(n,) dB by which readings are above those of a place, of the access points that were heard both times.

    Of what is in the direction of x and of y, `more_db` (2,) are read there.
    """
    here = slice(places.heard.starts[place], places.heard.starts[place + 1])
    there = places.heard.rssi[here] + places.towards[here] @ more_db
    level = dict(zip(places.heard.aps[here].tolist(), there.tolist(), strict=True))
    numbers = places.fingerprinted.numbers
    known = zip([numbers.get(b, -1) for b in readings.bssids], readings.rssi.tolist(), strict=True)
    return np.array([rssi - level[a] for a, rssi in known if a in level], np.float64)
