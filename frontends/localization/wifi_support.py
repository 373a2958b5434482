"""What WiFi says of a pose: how much less likely it is there than where WiFi puts the robot."""

import math
from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.localization.wifi.particles import Cloud
from wayfi.frontends.localization.wifi_belief import PlaceBelief

LEAST_NATS = -12.0  # beyond, all is equally impossible: WiFi was never seen to be surer and right
LEAST = 1e-300  # keeps the logarithm finite
NEAR_M = 0.25  # sigma of the density around a particle: a third of a place's, as 1500 particles ask (Silverman, 1986)
WIDE_M, WIDE = 0.6, 0.1  # sigma of the part of it by which WiFi may err beyond its belief: a place is 1 m wide
NEAR_RAD = 0.3  # the same of its heading, which the way between WiFi scans tells
FAR_M = 3.0  # from a particle, beyond which it adds nothing
ANY_HEADING = 0.005  # chance that the heading is any other: turned round, a pose is 5 nats less likely at most


class WifiSupport:
    """The density of the `cloud` of poses that the robot may have by WiFi, and the `places` that they make up.

    `heard` tells whether any scan has come at all.
    """

    def __init__(self, places: Sequence[PlaceBelief], cloud: Cloud | None = None) -> None:
        self.places, self.heard, self._cloud = tuple(places), cloud is not None, cloud
        self._peak, self._wide_peak = (
            max((self._density(p.T_map_base, p.floor, wide) for p in places), default=0.0) for wide in (WIDE, 1.0)
        )

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
        return _nats(self._density(T_map_base, floor, WIDE), self._peak)

    def wide_nats(self, T_map_base: Pose2, floor: int) -> float:
        """The same by the wide density alone, as if WiFi erred beyond its belief: places are contradicted by that."""
        return _nats(self._density(T_map_base, floor, 1.0), self._wide_peak)

    def metres(self, T_map_base: Pose2, floor: int) -> float:
        """The distance from a pose to WiFi's best place, m; infinite if that is on another floor."""
        if not self.known:
            return 0.0
        best = self.places[0]
        return best.T_map_base.distance(T_map_base) if best.floor == floor else math.inf

    def _density(self, T: Pose2, floor: int, wide: float) -> float:
        return 0.0 if self._cloud is None else float(_density(*self._cloud, T.x, T.y, T.theta, floor, wide))


def _nats(density: float, peak: float) -> float:
    return max(LEAST_NATS, min(0.0, math.log(max(density, LEAST) / peak))) if peak > 0.0 else 0.0


@njit(cache=True)
def _density(
    poses: Floats, floors: NDArray[np.int64], weights: Floats, x: float, y: float, theta: float, floor: int, wide: float
) -> float:
    """The sum over poses (n, 3) on a floor of their weights (n,), each times two Gaussians of its distance.

    `wide` (0 to 1) is the part of the wide one.
    """
    total, narrow = 0.0, (1.0 - wide) * (WIDE_M / NEAR_M) ** 2
    for k in range(len(poses)):
        d2 = (poses[k, 0] - x) ** 2 + (poses[k, 1] - y) ** 2
        if d2 < FAR_M**2 and floors[k] == floor:
            turned = (theta - poses[k, 2] + np.pi) % (2.0 * np.pi) - np.pi
            heading = ANY_HEADING + (1.0 - ANY_HEADING) * math.exp(-0.5 * (turned / NEAR_RAD) ** 2)
            near = narrow * math.exp(-0.5 * d2 / NEAR_M**2) + wide * math.exp(-0.5 * d2 / WIDE_M**2)
            total += weights[k] * heading * near
    return total
