"""Localisation in a map: proposes places, follows hypotheses, and claims one when independent evidence confirms it."""

import numpy as np

from wayfi.backend.graph.health import FailureCategory, Health, State
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.localization.claims import judge_claim, why_not_confirmed
from wayfi.frontends.localization.hypotheses import Hypothesis, is_same
from wayfi.frontends.localization.local_track import LocalTrack
from wayfi.frontends.localization.localization_config import LocalizationConfig
from wayfi.frontends.localization.map_matching import Fix, MapMatcher
from wayfi.frontends.localization.map_places import MapPlaces
from wayfi.frontends.localization.place_search import PlaceSearch, places_around
from wayfi.frontends.localization.wifi_stand_in import PlaceBelief, WifiStandIn
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.wifi.readings import Readings

ONE_PLACE_M, ONE_PLACE_RAD = 0.5, 0.2  # nearer than this, two hypotheses are one
TRIED_BACK_M = 4.0  # of path: a place that is found is tried on the keyframes so far back as well
AGAIN_M = 1.0  # of path between two searches
FOUND_SIGMA_M, FOUND_SIGMA_RAD = 0.15, 0.05


class Localizer:
    """Where the robot is in the map, given the local `track`: `claimed`, or still sought."""

    def __init__(
        self, building: BuildingMap, track: LocalTrack, lidar: LidarConfig, config: LocalizationConfig
    ) -> None:
        self._track, self._lidar, self._config = track, lidar, config
        self._places = MapPlaces(building, lidar, config.places)
        self._matcher = MapMatcher(lidar, config.fix)
        self._wifi = WifiStandIn(building)
        self._hypotheses: list[Hypothesis] = []
        self._search: PlaceSearch | None = None
        self._searched_m = -np.inf
        self._covered: set[int] = set()
        self._elsewhere = 0
        self.claimed: Hypothesis | None = None
        self.health = Health(State.RELOCALISING, "no place has been found yet", FailureCategory.NOT_FOUND_YET)

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """All hypotheses, the claimed one among them."""
        return self._hypotheses

    def add_keyframe(self) -> None:
        """Go on to the track's newest keyframe."""
        step = self._track.step_to(self._track.newest)
        self._wifi.move(step.pose, step.covariance)
        if step.moved:
            self._covered.clear()
            self._search = None
        if self.claimed is not None:
            self._verify(self.claimed)
            self._judge()

    def add_wifi(self, receiver: str, readings: Readings) -> None:
        """Use a WiFi scan."""
        self._wifi.add(receiver, readings)
        if self.claimed is None:
            return
        metres, share = self._wifi.disagreement(self.claimed.T_map_base)
        apart = share > 0.97 and metres > self._config.claim.wifi_apart_m
        self._elsewhere = self._elsewhere + 1 if apart else 0
        self._judge()

    def add_initial(self, T_map_base: Pose2, covariance: Floats) -> None:
        """Follow a pose that was given from outside as one more hypothesis."""
        if self._track.newest >= 0:
            self._hypotheses.append(Hypothesis("initial pose", T_map_base, covariance, self._track.newest))

    def go_on(self) -> None:
        """Do the next slice of the work that waits: verify a hypothesis, or search a part of a place."""
        if self._track.newest < 0:
            return
        lagging = min(self._hypotheses, key=lambda h: h.keyframe, default=None)
        if lagging is not None and lagging.keyframe < self._track.newest:
            self._verify(lagging)
            self._judge()
        elif self._search is not None:
            self._search.go_on()
            if self._search.done:
                self._adopt(self._search)
                self._search = None
        elif self.claimed is None:
            self._begin_search()

    def _verify(self, hypothesis: Hypothesis) -> None:
        """Move a hypothesis to the next keyframe whose scan says something new, and compare that with the map."""
        track = self._track
        if hypothesis.keyframe < track.first:
            hypothesis.keyframe = track.first
        number = hypothesis.keyframe + 1 if hypothesis.keyframe < track.newest else track.newest
        hypothesis.move_to(number, track)
        scan = track.scan(number)
        if scan is None or len(scan.points) < self._lidar.min_points or not len(self._places):
            return
        place, _ = self._places.nearest(np.array([hypothesis.T_map_base.x, hypothesis.T_map_base.y]))
        fix = self._matcher.fix(scan, self._places.place(place), hypothesis.T_map_base, hypothesis.covariance)
        hypothesis.update(fix, track.point(number).path_m, self._config.claim)

    def _begin_search(self) -> None:
        """Search the newest scan at the places that WiFi names and that have not been searched yet."""
        track = self._track
        scan, path_m = track.scan(track.newest), track.point(track.newest).path_m
        if scan is None or len(scan.points) < self._lidar.min_points or not len(self._places):
            return
        proposed: list[int] = []
        for belief in self._wifi.places(8):
            proposed += self._around(belief)
        if not set(proposed) - self._covered and path_m - self._searched_m < AGAIN_M:
            return
        wanted = list(dict.fromkeys(proposed))[: self._config.search.most_places]
        if wanted:
            self._searched_m = path_m
            self._covered = set(wanted)
            self._search = PlaceSearch(
                track.newest, scan, wanted, self._places, self._matcher, self._lidar, self._config.search
            )

    def _around(self, belief: PlaceBelief) -> list[int]:
        sigma_m = float(np.sqrt(belief.covariance[0, 0]))
        xy = np.array([belief.T_map_base.x, belief.T_map_base.y])
        return places_around(self._places, xy, 2.5 * sigma_m, self._config.search.most_places)

    def _adopt(self, search: PlaceSearch) -> None:
        """Follow what a search has found, from some metres back on."""
        for fix in sorted(search.found, key=lambda fix: -fix.fit):
            self._follow(fix, search.keyframe)
        self._prune()

    def _follow(self, fix: Fix, keyframe: int) -> None:
        track = self._track
        if keyframe < track.first:
            return
        back = keyframe
        while back > track.first and track.point(keyframe).path_m - track.point(back - 1).path_m <= TRIED_BACK_M:
            back -= 1
        for other in self._hypotheses:
            if track.first <= other.keyframe:
                T = fix.T_map_base @ track.between(keyframe, other.keyframe)
                if is_same(T, other.T_map_base, ONE_PLACE_M, ONE_PLACE_RAD):
                    return
        T = fix.T_map_base @ track.between(keyframe, back)
        covariance = np.diag([FOUND_SIGMA_M**2, FOUND_SIGMA_M**2, FOUND_SIGMA_RAD**2])
        self._hypotheses.append(Hypothesis("search", T, covariance, back))

    def _prune(self) -> None:
        """Drop hypotheses that contradict the map, or that are another one by now; keep the best."""
        kept: list[Hypothesis] = []
        ordered = sorted(self._hypotheses, key=lambda h: (h is not self.claimed, -_quality(h)))
        for h in ordered:
            same = any(
                h.keyframe == other.keyframe and is_same(h.T_map_base, other.T_map_base, ONE_PLACE_M, ONE_PLACE_RAD)
                for other in kept
            )
            if h is self.claimed or (h.contradicted < 3 and h.unsure < 6 and not same):
                kept.append(h)
        self._hypotheses = kept[: self._config.most_hypotheses]

    def _judge(self) -> None:
        self._prune()
        config = self._config.claim
        if self.claimed is not None:
            self.health = judge_claim(self.claimed, self.health.state, self._elsewhere, config)
            if self.health.state is State.LOST:
                self._give_up()
            return
        waiting = any(h.keyframe < self._track.newest for h in self._hypotheses)
        best = max(self._hypotheses, key=_quality, default=None)
        if best is None or best.keyframe < self._track.newest:
            return
        rivals = [h for h in self._hypotheses if h is not best]
        why_not = why_not_confirmed(best, rivals, self._search is None and not waiting, config)
        lost = self.health.state is State.LOST
        if why_not is None:
            self.claimed, self._elsewhere = best, 0
            self.health = Health(State.TRACKING, f"{best.agreed} scans along the way agree with the map")
        elif not lost:
            self.health = why_not

    def _give_up(self) -> None:
        """The pose is not claimed any more; its hypothesis stays among the others."""
        assert self.claimed is not None
        self.claimed.doubt()
        self.claimed, self._elsewhere = None, 0
        self._covered.clear()
        self._searched_m = -np.inf


def _quality(h: Hypothesis) -> float:
    return h.evidence / max(h.fixes, 1) if h.fixes else -np.inf
