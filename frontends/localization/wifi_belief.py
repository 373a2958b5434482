"""Where WiFi and wheels put the robot in a known map, or that it is not in it."""

from collections.abc import Sequence

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, adjoint
from wayfi.frontends.localization.wifi.belief_config import WifiBeliefConfig
from wayfi.frontends.localization.wifi.clusters import PlaceBelief, places_of
from wayfi.frontends.localization.wifi.directivity import NO_GAIN
from wayfi.frontends.localization.wifi.likelihood import AWAY_M, ScanFit, evidence_of_scan, fit_scan
from wayfi.frontends.localization.wifi.off_ways import Away, OffWays
from wayfi.frontends.localization.wifi.particles import Cloud, Particles
from wayfi.frontends.localization.wifi.radio_places import RadioPlaces, radio_places
from wayfi.frontends.localization.wifi.receiver_offsets import ReceiverOffsets
from wayfi.frontends.localization.wifi.seeds import draw_seeds
from wayfi.frontends.localization.wifi.sharpness import learn_sharpness
from wayfi.frontends.localization.wifi.where import Where, log_ratios
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.wifi.readings import Readings

__all__ = ["PlaceBelief", "WifiBelief"]

FOUND = 0.5  # of the weight within some metres of the map's ways: with less a receiver's offset is not learnt


class WifiBelief:
    """A belief over the robot's pose in a map, from WiFi scans and the wheels' steps in the order they came.

    Monte Carlo localisation (Fox et al., 1999). At each scan some particles begin anew where it fits, with the share of
    the weight that the chance `elsewhere` and their likelihood give them, so that a robot that was moved is found.
    """

    def __init__(self, building: BuildingMap, config: WifiBeliefConfig) -> None:
        self._config = config
        self._map = radio_places(building, config.likelihood)
        self._sharpness = learn_sharpness(building, self._map, config) if self._map else config.within_map
        self._offsets = ReceiverOffsets(building.calibration.receivers, config.likelihood)
        self._off_ways = OffWays(self._map, config.likelihood) if self._map else None
        self._particles = Particles(config.particles)
        self._step, self._covariance = Pose2(), np.zeros((3, 3))
        self._moved_m = np.inf  # of path since the evidence that was used
        self._sown = 0

    def move(self, step: Pose2, covariance: Floats) -> None:
        """Move on by the wheels' `step`, with its (3, 3) covariance in the axes of base_link before it."""
        if not (step.is_finite() and np.isfinite(covariance).all()):
            return
        rotation = adjoint(Pose2(0.0, 0.0, self._step.theta))
        d = rotation @ step.array()
        lever = np.array([[1.0, 0.0, -d[1]], [0.0, 1.0, d[0]], [0.0, 0.0, 1.0]])
        self._covariance = lever @ self._covariance @ lever.T + rotation @ covariance @ rotation.T
        self._step = self._step @ step
        self._moved_m += float(np.hypot(step.x, step.y))

    def spread_over(self, floors: Sequence[int]) -> None:
        """The robot may have taken an elevator to any of these floors."""
        self._particles.spread_over(floors)

    def add(self, receiver: str, readings: Readings) -> None:
        """Use a scan, or the mean of some, that `receiver` heard where the robot is now."""
        if self._map is None or self._off_ways is None or not readings.bssids:
            return
        self._catch_up()
        config, offset = self._config, self._offsets.of(receiver)
        gain = self._map.fingerprinted.gains.get(receiver, NO_GAIN)
        fit = fit_scan(self._map, readings, offset.offset_db, offset.sigma_db, config.likelihood, gain)
        evidence = self._evidence(fit.known)
        self._particles.draw(config.particles - config.seeds, config.roughening_m, config.roughening_rad)
        self._sow(self._map, fit, evidence)
        where = Where.of(self._particles.poses, self._particles.floor, self._map, fit)
        self._weigh(fit, where, evidence)
        self._offsets.learn(receiver, *self._offset(fit, where))
        for named in self.places(1):
            self._off_ways.add(readings, named, gain)

    def places(self, most: int) -> list[PlaceBelief]:
        """The `most` heaviest places, the heaviest first; their weights lack to 1 what is not in this map."""
        self._catch_up()
        p, config = self._particles, self._config
        return places_of(p.poses, p.floor, p.weights, most, config.near_m, config.sigma_floor_m)

    def cloud(self) -> Cloud:
        """The poses that the robot may have, with their weights."""
        self._catch_up()
        return self._particles.cloud()

    @property
    def away(self) -> Away:
        """How far from the ways of the map the robot is."""
        return self._off_ways.away if self._off_ways else Away()

    def _catch_up(self) -> None:
        """Move the particles by what the wheels have driven since."""
        if self._covariance.any() or self._step != Pose2():
            self._particles.move(self._step, self._covariance)
            self._step, self._covariance = Pose2(), np.zeros((3, 3))

    def _evidence(self, known: int) -> float:
        """The share of its log ratio that a scan counts, which heard so many access points of the map."""
        evidence = evidence_of_scan(known, self._moved_m, self._config.likelihood)
        self._moved_m = 0.0
        return evidence

    def _sow(self, places: RadioPlaces, fit: ScanFit, evidence: float) -> None:
        """Begin some particles anew where the scan fits, before it is weighed.

        The seeds are drawn by their likelihood, and weigh what they would if all poses had been drawn evenly.
        """
        p, config = self._particles, self._config
        begins = not p.weights.any()
        share = 1.0 - config.begins_outside if begins else config.elsewhere
        count = len(p.weights) if begins else config.seeds
        drawn = draw_seeds(places, fit, evidence, count, self._sown, config)
        if drawn is None:
            return
        self._sown += count
        p.leave(config.outside)
        p.sow(drawn.poses, drawn.floor, drawn.weights, share)

    def _weigh(self, fit: ScanFit, where: Where, evidence: float) -> None:
        p = self._particles
        log_ratio = evidence * log_ratios(fit, where)
        if p.weights.any():
            sharp = self._sharpness * log_ratio
            p.weigh(sharp + _log_mean(log_ratio, p.weights) - _log_mean(sharp, p.weights))

    def _offset(self, fit: ScanFit, where: Where) -> tuple[float, float]:
        """The receiver's offset by the scan, over the places where the robot may be, and the readings behind it."""
        weights = np.where((where.row >= 0) & (where.distance_m < AWAY_M[1]), self._particles.weights, 0.0)
        total = float(weights.sum())
        if total < FOUND:
            return 0.0, 0.0
        heading = np.rint(where.heading).astype(np.int64) % fit.log_ratio.shape[1]
        return (
            float(weights @ fit.offset_db[where.row, heading] / total),
            float(weights @ fit.common[where.row, heading]),
        )


def _log_mean(log_ratio: Floats, weights: Floats) -> float:
    """The logarithm of the mean of exp(`log_ratio`) (n,) by weights (n,)."""
    top = float(log_ratio[weights > 0.0].max())
    return top + float(np.log(weights @ np.exp(np.minimum(log_ratio - top, 0.0)) / weights.sum()))
