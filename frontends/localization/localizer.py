"""Localisation in a map: proposes places, follows hypotheses, and claims one when independent evidence confirms it."""

from wayfi.backend.graph.health import FailureCategory, Health, State
from wayfi.backend.pose2 import Floats, Pose2, diagonal_covariance
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.localization.claims import judge_claim, score, why_not_confirmed
from wayfi.frontends.localization.follower import Follower
from wayfi.frontends.localization.hypotheses import Hypothesis, is_same
from wayfi.frontends.localization.local_track import LocalTrack
from wayfi.frontends.localization.localization_config import LocalizationConfig
from wayfi.frontends.localization.proposals import Proposals, Proposed
from wayfi.frontends.localization.wifi_stand_in import WifiStandIn
from wayfi.frontends.localization.wifi_support import WifiSupport
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.wifi.readings import Readings

WIFI_PLACES = 8  # asked of WiFi: what it gives the next ones is not worth a search

NOT_YET = Health(State.RELOCALISING, "no place has been found yet", FailureCategory.NOT_FOUND_YET)


class Localizer:
    """Where the robot is in the map, given the local `track`: `claimed`, or still sought."""

    def __init__(
        self, building: BuildingMap, track: LocalTrack, lidar: LidarConfig, config: LocalizationConfig
    ) -> None:
        self._track, self._config = track, config
        self._follower = Follower(building, track, lidar, config)
        self._proposals = Proposals(building, track, lidar, config)
        self._belief = WifiStandIn(building)
        self._wifi = WifiSupport(())
        self._hypotheses: list[Hypothesis] = []
        self._elsewhere = 0
        self.claimed: Hypothesis | None = None
        self.health = NOT_YET

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """All hypotheses, the claimed one among them."""
        return self._hypotheses

    def add_keyframe(self) -> None:
        """Go on to the track's newest keyframe."""
        step = self._track.step_to(self._track.newest)
        self._belief.move(step.pose, step.covariance)
        if self._wifi.known:
            self._wifi = WifiSupport(self._belief.places(WIFI_PLACES))
        if step.moved:
            self._proposals.restart()
        if self.claimed is None:
            return
        if self._follower.follow_claim(self.claimed):
            self._judge_claim()
        else:
            text = "the scans do not fit those before, nor the map here: the robot was moved"
            self._give_up(Health(State.LOST, text, FailureCategory.ROBOT_MOVED))

    def add_wifi(self, receiver: str, readings: Readings) -> None:
        """Use a WiFi scan."""
        self._belief.add(receiver, readings)
        self._wifi = WifiSupport(self._belief.places(WIFI_PLACES))
        if self.claimed is None:
            return
        config, T = self._config.claim, self.claimed.T_map_base
        apart = self._wifi.nats(T) < -config.elsewhere_below and self._wifi.metres(T) > config.wifi_apart_m
        self._elsewhere = self._elsewhere + 1 if apart else 0
        self._judge_claim()

    def add_initial(self, T_map_base: Pose2, covariance: Floats) -> None:
        """Follow a pose that was given from outside as one more hypothesis."""
        if self._track.newest >= 0:
            self._hypotheses.append(Hypothesis(T_map_base, covariance, self._track.newest))

    def take_over(self, T_map_base: Pose2, covariance: Floats) -> None:
        """Claim a pose at the newest keyframe that was claimed by others, who knew the map, until now."""
        self.claimed = Hypothesis(T_map_base, covariance, self._track.newest)
        self._hypotheses.append(self.claimed)
        self.health = Health(State.TRACKING, "the pose was known before the mode was changed")

    def go_on(self) -> None:
        """Do the next slice of the work that waits: compare some scans with the map, or search on."""
        if self._track.newest < 0:
            return
        left = self._config.compared
        for hypothesis in sorted(self._hypotheses, key=lambda h: -h.evidence):
            left -= self._follower.catch_up(hypothesis, left)
        if left == self._config.compared and (self.claimed is None or self._proposals.running):
            self._search()
        if self.claimed is None:
            self._drop()
            self._judge()

    def _search(self) -> None:
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
                if is_same(T, other.T_map_base):
                    other.proposed += 1
                    return
        back = track.back(config.reach_m)
        T = proposed.T_map_base @ track.between(proposed.keyframe, back)
        # its way up to there is taken to have fitted as well as that of any other
        before = [e for h in self._hypotheses if (e := h.evidence_at(back)) is not None]
        covariance = diagonal_covariance(config.sigma_m, config.sigma_rad)
        self._hypotheses.append(Hypothesis(T, covariance, back, max(before, default=0.0)))

    def _drop(self) -> None:
        """Drop the hypotheses that the laser contradicts, that are far worse than the best, or another one by now."""
        config = self._config.claim
        ordered = sorted(self._hypotheses, key=lambda h: -score(h, self._wifi))
        seasoned = [h for h in ordered if h.agreed >= config.fixes]
        least = score(seasoned[0], self._wifi) - config.drop_gain if seasoned else -float("inf")
        kept: list[Hypothesis] = []
        for h in ordered:
            same = any(h.keyframe == k.keyframe and is_same(h.T_map_base, k.T_map_base) for k in kept)
            if not same and h.contradicted < config.drop_fixes and score(h, self._wifi) >= least:
                kept.append(h)
        self._hypotheses = kept[: self._config.most_hypotheses]

    def _judge(self) -> None:
        """Claim the best hypothesis if the evidence confirms it."""
        if any(h.keyframe < self._track.newest for h in self._hypotheses) or not self._hypotheses:
            return
        best, *rivals = sorted(self._hypotheses, key=lambda h: -score(h, self._wifi))
        why_not = why_not_confirmed(best, rivals, self._wifi, self._proposals.complete, self._config.claim)
        if why_not is None:
            self.claimed, self._elsewhere = best, 0
            self.health = Health(State.TRACKING, f"{best.agreed} scans along {best.agreed_m:.1f} m agree with the map")
        elif self.health.state is not State.LOST:
            self.health = why_not

    def _judge_claim(self) -> None:
        assert self.claimed is not None
        health = judge_claim(self.claimed, self.health.state, self._elsewhere, self._config.claim)
        if health.state is State.LOST:
            self._give_up(health)
        self.health = health

    def _give_up(self, health: Health) -> None:
        """The pose is not claimed any more; its hypothesis stays among the others."""
        assert self.claimed is not None
        self.claimed.doubt()
        self.claimed, self._elsewhere, self.health = None, 0, health
        self._proposals.restart()
