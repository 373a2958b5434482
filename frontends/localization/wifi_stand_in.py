"""Where WiFi puts the robot, by the fingerprints of the map that the last scans are most similar to."""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.wifi.fingerprint_index import FingerprintIndex
from wayfi.frontends.wifi.readings import Readings

SIGMA_DB = 6.0
SHARPNESS = 25.0  # of similarity: a fingerprint 0.1 less similar is 12 times less likely
FORGOTTEN_PER_M = 0.1
LEAST_SIMILAR = 0.2
CLUSTER_M = 6.0


@dataclass(frozen=True, slots=True, eq=False)
class PlaceBelief:
    """A place of the robot with its (3, 3) covariance, heading wide open where it is not known, and its weight."""

    T_map_base: Pose2
    covariance: Floats
    weight: float


class WifiStandIn:
    """Keeps for each fingerprint of the map how well the last scans fit it."""

    def __init__(self, building: BuildingMap) -> None:
        self._index = FingerprintIndex(SIGMA_DB)
        self._places = building.fingerprint_poses()[:, :2]
        for fingerprint in building.fingerprints:
            self._index.add(fingerprint.readings)
        self._scores = np.zeros(len(self._places))
        self._similar = 0.0

    def move(self, step: Pose2, covariance: Floats) -> None:  # noqa: ARG002 - as the belief's
        """Move with the robot: what was heard before counts less."""
        metres = float(np.hypot(step.x, step.y))
        self._scores *= np.exp(-FORGOTTEN_PER_M * metres * 3)

    def add(self, receiver: str, readings: Readings) -> None:  # noqa: ARG002 - as the belief's
        """Add a scan."""
        if len(self._places) == 0 or len(readings.bssids) == 0:
            return
        number = self._index.add(readings)
        similarity = self._index.similarities(np.array([number]), np.arange(len(self._places)))[0]
        self._index.size -= 1
        self._similar = 0.5 * self._similar + 0.5 * float(similarity.max())
        self._scores = 0.7 * self._scores + 0.5 * SHARPNESS * (similarity - similarity.max())

    def places(self, most: int) -> list[PlaceBelief]:
        """The best places, best first."""
        if self._similar < LEAST_SIMILAR:
            return []
        weights = np.exp(self._scores - self._scores.max())
        weights /= weights.sum()
        found: list[PlaceBelief] = []
        while len(found) < most and weights.sum() > 0.03:
            best = int(np.argmax(weights))
            near = np.hypot(*(self._places - self._places[best]).T) < CLUSTER_M
            share = float(weights[near].sum())
            middle = weights[near] @ self._places[near] / share
            spread = float(weights[near] @ ((self._places[near] - middle) ** 2).sum(axis=1) / share)
            sigma2 = 2.5**2 + spread
            found.append(
                PlaceBelief(Pose2(float(middle[0]), float(middle[1]), 0.0), np.diag([sigma2, sigma2, 100.0]), share)
            )
            weights[near] = 0.0
        return found

    def disagreement(self, T_map_base: Pose2) -> tuple[float, float]:
        """By how many metres WiFi puts the robot elsewhere, and with what probability."""
        places = self.places(8)
        if not places:
            return 0.0, 0.0
        far = [p for p in places if p.T_map_base.distance(T_map_base) > 3 * np.sqrt(p.covariance[0, 0])]
        near_weight = sum(p.weight for p in places) - sum(p.weight for p in far)
        return places[0].T_map_base.distance(T_map_base), 1.0 - near_weight
