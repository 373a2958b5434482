"""What WiFi says of a pose: how much less likely it is there than where WiFi puts the robot."""

import math
from collections.abc import Sequence

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, wrap_all
from wayfi.frontends.localization.wifi_belief import PlaceBelief

LEAST_NATS = -12.0  # beyond, all is equally impossible: WiFi was never seen to be surer and right
LEAST = 1e-300  # keeps the logarithm finite
FLOOR_M = 0.5  # added to WiFi's sigma: what a map's fingerprints are spread by
FLOOR_RAD = 0.3  # added to that of the heading, which the way between WiFi scans tells
ANY_HEADING = 0.005  # chance that the heading is any other: turned round, a pose is 5 nats less likely at most


class WifiSupport:
    """The mixture of the places that WiFi names, as a density of the pose on each floor.

    `heard` tells whether any scan has come at all.
    """

    def __init__(self, places: Sequence[PlaceBelief], heard: bool = False) -> None:
        self.places, self.heard = tuple(places), heard
        self._means = np.array([(p.T_map_base.x, p.T_map_base.y) for p in places]).reshape(-1, 2)
        covariances = np.array([_position(p) for p in places]).reshape(-1, 2, 2)
        self._information = np.linalg.inv(covariances)
        self._headings = np.array([p.T_map_base.theta for p in places])
        self._sigmas_rad = np.array([math.hypot(p.sigma_rad, FLOOR_RAD) for p in places])
        self._heights = np.array([p.weight for p in places]) / np.sqrt(np.linalg.det(covariances))
        self._floors = np.array([p.floor for p in places], np.int64)
        self._peak = max((self._density(p.T_map_base, p.floor) for p in places), default=0.0)

    @property
    def known(self) -> bool:
        """Whether WiFi names any place."""
        return self._peak > 0.0

    @property
    def weight(self) -> float:
        """The probability, 0 to 1, that WiFi gives to the places that it names."""
        return sum(place.weight for place in self.places)

    def is_elsewhere(self, least_weight: float) -> bool:
        """Whether WiFi gives less than `least_weight` to all places of this map."""
        return self.heard and self.weight < least_weight

    def nats(self, T_map_base: Pose2, floor: int) -> float:
        """The logarithm of the density at a pose on a floor over that at WiFi's best place; 0 where WiFi names none."""
        if not self.known:
            return 0.0
        return max(LEAST_NATS, min(0.0, math.log(max(self._density(T_map_base, floor), LEAST) / self._peak)))

    def metres(self, T_map_base: Pose2, floor: int) -> float:
        """The distance from a pose to WiFi's best place, m; infinite if that is on another floor."""
        if not self.known:
            return 0.0
        best = self.places[0]
        return best.T_map_base.distance(T_map_base) if best.floor == floor else math.inf

    def _density(self, T: Pose2, floor: int) -> float:
        d = np.array([T.x, T.y]) - self._means
        chi2 = np.einsum("ni,nij,nj->n", d, self._information, d)
        turned = wrap_all(T.theta - self._headings) / self._sigmas_rad
        heading = ANY_HEADING + (1.0 - ANY_HEADING) * np.exp(-0.5 * turned**2)
        here = np.where(self._floors == floor, heading * np.exp(-0.5 * chi2), 0.0)
        return float(self._heights @ here)


def _position(place: PlaceBelief) -> Floats:
    return np.asarray(place.covariance[:2, :2] + FLOOR_M**2 * np.eye(2))
