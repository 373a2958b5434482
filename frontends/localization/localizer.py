"""Localisation in a map: proposes places, follows hypotheses, and claims one when independent evidence confirms it."""

from dataclasses import replace

import numpy as np

from wayfi.backend.graph.health import FailureCategory, Health, State
from wayfi.backend.pose2 import Floats, Pose2, diagonal_covariance
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.localization.claims import judge_claim, why_not_confirmed
from wayfi.frontends.localization.cluster import Cluster, cluster_of, evidence_before, is_twin, score
from wayfi.frontends.localization.coarse_claim import CoarseClaim
from wayfi.frontends.localization.follower import Follower
from wayfi.frontends.localization.hypotheses import Hypothesis, is_same
from wayfi.frontends.localization.local_track import LocalTrack
from wayfi.frontends.localization.localization_config import LocalizationConfig
from wayfi.frontends.localization.proposals import Proposals, Proposed
from wayfi.frontends.localization.wifi_belief import WifiBelief
from wayfi.frontends.localization.wifi_support import WifiSupport
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.wifi.readings import Readings

WIFI_PLACES = 8  # asked of WiFi: what it gives the next ones is not worth a search

IN_ELEVATOR = Health(
    State.RELOCALISING,
    "the robot may be in an elevator: its floor is sought once it has left",
    FailureCategory.FLOOR_UNKNOWN,
)
NOT_YET = Health(State.RELOCALISING, "no place has been found yet", FailureCategory.NOT_FOUND_YET)


class Localizer:
    """Where the robot is in the map, given the local `track`: `claimed`, or still sought."""

    def __init__(
        self, building: BuildingMap, track: LocalTrack, lidar: LidarConfig, config: LocalizationConfig
    ) -> None:
        self._track, self._config = track, config
        self._follower = Follower(building, track, lidar, config)
        self._proposals = Proposals(building, track, lidar, config)
        self._belief = WifiBelief(building, config.wifi)
        self._wifi = WifiSupport(())
        self._hypotheses: list[Hypothesis] = []
        self._elsewhere, self._elsewhere_m = 0, 0.0  # WiFi scans in a row, and the path at the last that counted
        self._coarse = CoarseClaim(config.coarse_claim)
        self._worked_ns, self._due = 0, 0.0  # the slices of work that are due by then
        self._scanned_m = 0.0  # of path, up to the last scan
        self._floors = building.floors
        self.in_elevator = False
        self._cluster: Cluster | None = None
        self.claimed: Hypothesis | None = None
        self.health = NOT_YET

    def pose(self) -> tuple[int, Pose2, Floats] | None:
        """The local keyframe, the pose in `map` and its (3, 3) covariance that are claimed; None while none are."""
        if self.claimed is None:
            return self._pose_by_wifi()
        cluster = self._cluster
        assert cluster is not None
        return cluster.keyframe, cluster.T_map_base, cluster.covariance

    def _pose_by_wifi(self) -> tuple[int, Pose2, Floats] | None:
        place = self._coarse.claimed
        return None if place is None else (self._track.newest, place.T_map_base, place.covariance)

    @property
    def floor(self) -> int | None:
        """The floor of the pose that is claimed; None while none is, unless the map has but one."""
        if len(self._floors) == 1:
            return self._floors[0]
        place = self.claimed or self._coarse.claimed
        return None if place is None else place.floor

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """All hypotheses, the claimed one among them."""
        return self._hypotheses

    def add_keyframe(self) -> None:
        """Go on to the track's newest keyframe."""
        step = self._track.step_to(self._track.newest)
        self._belief.move(step.pose, step.covariance)
        if self._wifi.heard:
            self._wifi = WifiSupport(self._belief.places(WIFI_PLACES), self._belief.cloud())
        if step.moved:
            self._proposals.restart()
        if self.claimed is None:
            self._judge_by_wifi()
            return
        if self._follower.follow_claim(self.claimed):
            self._judge_claim()
        else:
            text = "the scans do not fit those before, nor the map here: the robot was moved"
            self._give_up(Health(State.LOST, text, FailureCategory.ROBOT_MOVED))

    def add_wifi(self, receiver: str, readings: Readings) -> None:
        """Use a WiFi scan."""
        self._belief.add(receiver, readings)
        self._wifi = WifiSupport(self._belief.places(WIFI_PLACES), self._belief.cloud())
        if self.claimed is None:
            return
        config, T = self._config.claim, self.claimed.T_map_base
        floor = self.claimed.floor
        apart = self._wifi.wide_nats(T, floor) < -config.wifi_below_best
        apart &= self._wifi.metres(T, floor) > config.wifi_apart_m
        apart |= self._wifi.is_elsewhere(config.least_in_map)
        path_m = self._track.point(self._track.newest).path_m
        if not apart:
            self._elsewhere = 0
        elif not self._elsewhere or path_m - self._elsewhere_m >= config.wifi_scans_apart_m:
            self._elsewhere, self._elsewhere_m = self._elsewhere + 1, path_m

    def add_initial(self, T_map_base: Pose2, covariance: Floats) -> None:
        """Follow a pose that was given from outside as one more hypothesis, on each floor."""
        if self._track.newest >= 0:
            newest = self._track.newest
            self._hypotheses += [Hypothesis(T_map_base, covariance, newest, floor=floor) for floor in self._floors]

    def leave_floor(self) -> None:
        """The robot may be in an elevator: until `enter_floor` nothing is claimed, then it may be on any floor."""
        self.in_elevator = True
        self._belief.spread_over(self._floors)
        left, self._hypotheses = self.claimed, []
        if left is not None:
            self._hypotheses = [left, *(replace(left, floor=floor) for floor in self._floors if floor != left.floor)]
            for hypothesis in self._hypotheses:
                hypothesis.doubt()
        self.claimed, self._cluster, self._elsewhere, self.health = None, None, 0, IN_ELEVATOR
        self._coarse = CoarseClaim(self._config.coarse_claim)
        self._proposals.restart()

    def enter_floor(self) -> None:
        """The robot has left the elevator."""
        self.in_elevator = False

    def take_over(self, T_map_base: Pose2, covariance: Floats, floor: int) -> None:
        """Claim a pose on a floor at the newest keyframe that was claimed by others, who knew the map, until now."""
        self.claimed = Hypothesis(T_map_base, covariance, self._track.newest, floor=floor)
        self._hypotheses.append(self.claimed)
        self._cluster = cluster_of(self._hypotheses, self._track, self._wifi, self._config.claim, self.claimed)
        self.health = Health(State.TRACKING, "the pose was known before the mode was changed")

    def go_on(self, stamp_ns: int) -> None:
        """Do the next slices of the work that waits, more of them where messages are rare."""
        if self._track.newest < 0:
            return
        config, since_ns = self._config, max(stamp_ns - self._worked_ns, 0)
        self._due = min(self._due + since_ns / (1e9 * config.slice_s), config.most_due)
        self._worked_ns = stamp_ns
        slices = min(int(self._due), config.most_slices)
        self._due -= slices
        for _ in range(slices):
            self._work()

    def _work(self) -> None:
        """Compare some scans with the map, or search on."""
        left = self._config.compared
        for hypothesis in sorted(self._hypotheses, key=lambda h: -h.evidence):
            left -= self._follower.catch_up(hypothesis, left)
        sought = self.claimed is None or self.health.failure_category is FailureCategory.POSE_IMPRECISE
        if left == self._config.compared and (sought or self._proposals.running):
            self._search()
        self._drop()
        if self.claimed is None:
            self._judge()
        else:
            self._judge_claim()

    def _search(self) -> None:
        self._proposals.narrow(self._wifi)
        if self._proposals.running or self._proposals.begin(self._wifi):
            for proposed in self._proposals.go_on():
                self._follow(proposed)

    def _follow(self, proposed: Proposed) -> None:
        """Follow a pose that a search has found from some metres back on, unless it is followed already."""
        track, config = self._track, self._config.proposals
        if proposed.keyframe < track.first:
            return
        for other in self._hypotheses:
            if other.keyframe >= track.first:
                T = proposed.T_map_base @ track.between(proposed.keyframe, other.keyframe)
                if other.floor == proposed.floor and is_same(T, other.T_map_base):
                    other.proposed += 1
                    return
        back = track.back(config.reach_m)
        T = proposed.T_map_base @ track.between(proposed.keyframe, back)
        covariance = diagonal_covariance(config.sigma_m, config.sigma_rad)
        newcomer = Hypothesis(T, covariance, back, floor=proposed.floor)
        newcomer.evidence = evidence_before(newcomer, self._hypotheses, track, self._config.claim)
        self._hypotheses.append(newcomer)

    def _drop(self) -> None:
        """Drop the hypotheses that the laser contradicts, that are far worse than the best, or another one by now."""
        config = self._config.claim
        ordered = sorted(self._hypotheses, key=lambda h: (h is not self.claimed, -score(h, self._wifi)))
        seasoned = [score(h, self._wifi) for h in ordered if h.agreed >= config.fixes]
        least = max(seasoned, default=-np.inf) - config.drop_gain
        kept: list[Hypothesis] = []
        for h in ordered:
            same = any(_is_one(h, k) for k in kept)
            worse = score(h, self._wifi) < least and not self._is_twin_floor(h, ordered[0])
            if h is self.claimed or not (same or worse or h.contradicted >= config.drop_fixes):
                kept.append(h)
        self._hypotheses = kept[: self._config.most_hypotheses]

    def _is_twin_floor(self, hypothesis: Hypothesis, best: Hypothesis) -> bool:
        """Whether nothing but WiFi, which is silent, could tell the floor of a hypothesis from that of the best one."""
        other_floor = hypothesis.floor != best.floor and not self._wifi.known
        return other_floor and is_twin(hypothesis, best, self._config.claim)

    def _judge(self) -> None:
        """Claim the best place if the evidence confirms it."""
        config = self._config.claim
        cluster = cluster_of(self._hypotheses, self._track, self._wifi, config)
        if cluster is None or self.in_elevator:
            return
        why_not = why_not_confirmed(cluster, self._wifi, self._proposals.complete, config)
        if why_not is None:
            self.claimed, self._cluster, self._elsewhere = cluster.best, cluster, 0
            self.health = judge_claim(cluster, State.UNCERTAIN, 0, config)
        elif self.health.state is not State.LOST:
            self.health = why_not

    def _judge_by_wifi(self) -> None:
        """Claim WiFi's best place where the laser is silent; what was claimed so ends with the first scan."""
        config, track = self._config.coarse_claim, self._track
        path_m = track.point(track.newest).path_m
        if track.scan(track.newest) is not None:
            self.health = NOT_YET if self._coarse.claimed else self.health
            self._coarse, self._scanned_m = CoarseClaim(config), path_m
            return
        self._coarse.judge(self._wifi.places, path_m, self._belief.away)
        if path_m - self._scanned_m >= config.path_m:
            self.health = self._coarse.health

    def _judge_claim(self) -> None:
        """Judge the claimed place, whose best hypothesis may be another one by now."""
        assert self.claimed is not None
        self._cluster = cluster_of(self._hypotheses, self._track, self._wifi, self._config.claim, self.claimed)
        assert self._cluster is not None
        self.claimed = self._cluster.best
        health = judge_claim(self._cluster, self.health.state, self._elsewhere, self._config.claim)
        if health.state is State.LOST:
            self._give_up(health)
        self.health = health

    def _give_up(self, health: Health) -> None:
        """The pose is not claimed any more; its hypothesis stays among the others."""
        assert self.claimed is not None
        self.claimed.doubt()
        self.claimed, self._cluster, self._elsewhere, self.health = None, None, 0, health
        self._proposals.restart()


def _is_one(a: Hypothesis, b: Hypothesis) -> bool:
    return a.floor == b.floor and a.keyframe == b.keyframe and is_same(a.T_map_base, b.T_map_base)
