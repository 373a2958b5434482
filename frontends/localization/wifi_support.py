"""What WiFi says of a pose: how much less likely it is there than where WiFi puts the robot."""

import math
from collections.abc import Sequence

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.localization.wifi_stand_in import PlaceBelief

LEAST_NATS = -12.0  # beyond, all is equally impossible: WiFi was never seen to be surer and right
FLOOR_M = 1.0  # added to WiFi's sigma: what a map's fingerprints are spread by


class WifiSupport:
    """The mixture of the places that WiFi names, as a density of the position."""

    def __init__(self, places: Sequence[PlaceBelief]) -> None:
        self.places = tuple(places)
        self._peak = max((self._density(p.T_map_base) for p in places), default=0.0)

    @property
    def known(self) -> bool:
        """Whether WiFi names any place."""
        return self._peak > 0.0

    @property
    def weight(self) -> float:
        """The probability, 0 to 1, that WiFi gives to the places that it names."""
        return sum(place.weight for place in self.places)

    def nats(self, T_map_base: Pose2) -> float:
        """The logarithm of the density at a pose over that at WiFi's best place; 0 where WiFi names none."""
        if not self.known:
            return 0.0
        return max(LEAST_NATS, min(0.0, math.log(max(self._density(T_map_base), 1e-300) / self._peak)))

    def metres(self, T_map_base: Pose2) -> float:
        """The distance from a pose to WiFi's best place, m."""
        return self.places[0].T_map_base.distance(T_map_base) if self.known else 0.0

    def _density(self, T: Pose2) -> float:
        total = 0.0
        for place in self.places:
            covariance = _position(place)
            d = np.array([T.x - place.T_map_base.x, T.y - place.T_map_base.y])
            chi2 = float(d @ np.linalg.solve(covariance, d))
            total += place.weight * math.exp(-0.5 * chi2) / math.sqrt(float(np.linalg.det(covariance)))
        return total


def _position(place: PlaceBelief) -> Floats:
    return np.asarray(place.covariance[:2, :2] + FLOOR_M**2 * np.eye(2))
