"""Whether WiFi and wheels alone, without a laser, may claim a pose: a coarse one, good to some metres."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wayfi.backend.graph.health import FailureCategory, Health, State
from wayfi.frontends.localization.wifi.belief_config import CoarseClaimConfig
from wayfi.frontends.localization.wifi.clusters import PlaceBelief
from wayfi.frontends.localization.wifi.off_ways import Away

ON_WAYS = Away()
NOTHING = Health(State.RELOCALISING, "neither laser nor WiFi tells where the robot is", FailureCategory.NO_SENSOR)


class CoarseClaim:
    """Judges the places that WiFi names, scan by scan.

    A place is confirmed once it has held nearly all of the belief over some metres of path: the wheels then agree with
    WiFi about the way between many fingerprints. It is kept while it holds most, and given up when it has held little
    over as long a path.
    """

    def __init__(self, config: CoarseClaimConfig) -> None:
        self._config = config
        self._agrees_from_m: float | None = None
        self._doubted_from_m: float | None = None
        self._off_m = 0.0
        self.claimed: PlaceBelief | None = None
        self.health = NOTHING

    def judge(self, places: Sequence[PlaceBelief], path_m: float, away: Away = ON_WAYS) -> None:
        """Judge the `places`, the heaviest first, when the robot has driven `path_m`.

        Off the ways of the map, to be `away`, WiFi does not tell the place alone: it can be kept, not confirmed.
        """
        self._off_m = away.metres if self.claimed is None else away.unexplained_m
        best = _widened(places[0], self._off_m) if places else None
        if self.claimed is None:
            self._confirm(best, sum(place.weight for place in places), path_m)
        else:
            self._doubt(best, path_m)

    def _confirm(self, best: PlaceBelief | None, in_map: float, path_m: float) -> None:
        config = self._config
        if best is None or not self._is_sure(best, config.confirm_weight):
            self._agrees_from_m = None
            self.health = NOTHING if best is None else self._why_not(best, in_map)
            return
        self._agrees_from_m = path_m if self._agrees_from_m is None else self._agrees_from_m
        agreed_m = path_m - self._agrees_from_m
        if agreed_m < config.path_m:
            text = f"WiFi and wheels agree on a place over {agreed_m:.1f} m so far; {config.path_m:g} m confirm it"
            self.health = Health(State.RELOCALISING, text, FailureCategory.NOT_FOUND_YET)
            return
        self.claimed, self._doubted_from_m = best, None
        self.health = Health(State.TRACKING, f"WiFi and wheels agree on a place over {agreed_m:.1f} m")

    def _doubt(self, best: PlaceBelief | None, path_m: float) -> None:
        config = self._config
        if best is not None and self._is_sure(best, config.keep_weight):
            self.claimed, self._doubted_from_m = best, None
            self.health = Health(State.TRACKING, "WiFi and wheels agree on a place")
            return
        self._doubted_from_m = path_m if self._doubted_from_m is None else self._doubted_from_m
        if path_m - self._doubted_from_m < config.path_m and best is not None:
            self.claimed = best
            text = f"WiFi gives the place {self._chance(best)}"
            self.health = Health(State.UNCERTAIN, text, FailureCategory.WIFI_ELSEWHERE)
            return
        self.claimed = self._agrees_from_m = None
        self.health = Health(State.LOST, "WiFi does not name the place any more", FailureCategory.WIFI_ELSEWHERE)

    def _is_sure(self, place: PlaceBelief, weight: float) -> bool:
        config = self._config
        known = place.sigma_m <= config.sigma_m and place.sigma_rad <= config.sigma_rad
        return known and place.weight >= weight

    def _why_not(self, best: PlaceBelief, in_map: float) -> Health:
        if in_map < self._config.in_map:
            text = "WiFi hears little that is in this map"
            return Health(State.RELOCALISING, text, FailureCategory.NOT_IN_MAP)
        text = f"WiFi gives its best place {self._chance(best)}"
        return Health(State.RELOCALISING, text, FailureCategory.AMBIGUOUS)

    def _chance(self, place: PlaceBelief) -> str:
        text = f"a chance of {place.weight:.2f}, to {place.sigma_m:.1f} m"
        return text if self._off_m < self._config.sigma_m else f"{text}: {self._off_m:.0f} m off the ways of the map"


def _widened(place: PlaceBelief, sigma_m: float) -> PlaceBelief:
    return replace(place, covariance=place.covariance + np.diag([sigma_m**2, sigma_m**2, 0.0]))
