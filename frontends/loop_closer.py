"""Closing loops: candidates from the estimate and from WiFi, checked, judged, believed, and taken back if wrong."""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.backend.pose_graph import Between, PoseGraph
from wayfi.backend.wheel_calibration import WheelCalibration
from wayfi.frontends.calibration_search import Mode, best_mode, cost_of
from wayfi.frontends.closure import (
    Check,
    ClosureConfig,
    check,
    innovation_chi2,
    nearest_candidate,
    position_chi2,
)
from wayfi.frontends.events import CheckDone, ClosureJudged, ClosureKind, Event, SequenceMatched, Verdict, Warned
from wayfi.frontends.keyframes import Keyframes
from wayfi.frontends.lidar import LidarConfig
from wayfi.frontends.wifi import Fingerprint, WifiCandidate, WifiConfig

REVIEWED = 20  # accepted closures: those that a new one may contradict
UNCLAIMED_RAD = 30.0  # a sigma that says nothing of a heading


@dataclass(frozen=True, slots=True, eq=False)
class _Proposal:
    """A relative pose between two keyframes that may become a factor, and what speaks for it."""

    a: int
    b: int
    stamp_a_ns: int
    stamp_b_ns: int
    kind: ClosureKind
    proposed_by: str
    similarity: float
    T_a_b: Pose2
    covariance: Floats
    heading_claimed: bool
    residual_m: float
    inlier_ratio: float


class LoopCloser:
    """Holds every candidate with its verdict; adds factors to the graph and removes them."""

    def __init__(
        self,
        graph: PoseGraph,
        keyframes: Keyframes,
        prior: WheelCalibration,
        closure: ClosureConfig,
        lidar: LidarConfig,
        wifi: WifiConfig,
    ) -> None:
        self._graph = graph
        self._keyframes = keyframes
        self._prior = prior
        self._closure, self._lidar, self._wifi, self._search = closure, lidar, wifi, closure.search
        self._judged: list[ClosureJudged] = []
        self._accepted: dict[int, int] = {}
        self._last_check_m = -np.inf
        self.restarted = False

    def close_by_estimate(self, keyframe: int, stamp_ns: int, poses: Floats) -> list[Event]:
        """Check the newest keyframe against the nearest earlier one that the estimate offers."""
        here = self._keyframes[keyframe]
        if here.scan is None or here.point.path_m - self._last_check_m < self._closure.check_every_m:
            return []
        keyframes = self._keyframes
        a = nearest_candidate(keyframe, poses, keyframes.paths_m, keyframes.has_scan, self._closure)
        if a is None:
            return []
        self._last_check_m = here.point.path_m
        covariance = self._graph.relative_covariance(a, keyframe)
        guess = Pose2.of(poses[a]).between(Pose2.of(poses[keyframe]))
        return self._checked(a, keyframe, stamp_ns, guess, covariance, poses, "estimate", np.nan)

    def close_by_wifi(self, candidate: WifiCandidate, stamp_ns: int, poses: Floats) -> list[Event]:
        """Check what WiFi proposes with the laser; without one, judge the WiFi's own pose."""
        a, b = candidate.a.keyframe, candidate.b.keyframe
        events = self._sequence_event(candidate, stamp_ns, poses)
        self.restarted = False
        if a == b:
            return events
        if self._keyframes[a].scan is None or self._keyframes[b].scan is None:
            return events + self._judge_wifi(candidate, poses)
        covariance = self._graph.relative_covariance(a, b)
        guess = Pose2.of(poses[a]).between(Pose2.of(poses[b]))
        return events + self._checked(a, b, stamp_ns, guess, covariance, poses, "wifi", candidate.similarity)

    def review(self, poses: Floats) -> list[Event]:
        """Take back accepted closures that the estimate contradicts after all; the newest are looked at."""
        events: list[Event] = []
        for number in sorted(self._accepted)[-REVIEWED:]:
            judged = self._judged[number]
            T = Pose2.of(poses[judged.keyframe_a]).between(Pose2.of(poses[judged.keyframe_b]))
            distance = innovation_chi2 if judged.heading_claimed else position_chi2
            chi2 = distance(T, np.zeros((3, 3)), judged.T_a_b, judged.covariance)
            if chi2 > self._closure.remove_chi2:
                self._graph.remove(self._accepted.pop(number))
                events.append(self._change(number, Verdict.REMOVED, f"the estimate moved {chi2:.0f} chi2 away from it"))
        return events

    def _checked(
        self,
        a: int,
        b: int,
        stamp_ns: int,
        guess: Pose2,
        covariance: Floats,
        poses: Floats,
        proposed_by: str,
        similarity: float,
    ) -> list[Event]:
        reach = self._closure.submap_reach
        scans, placed, _ = self._keyframes.scans_around(a - reach, min(a + reach + 1, b), poses[a], poses)
        scan = self._keyframes[b].scan
        assert scan is not None
        done = check(scan, scans, placed, guess, covariance, self._closure, self._lidar)
        if done is None:
            return []
        proposal = self._lidar_proposal(a, b, done, proposed_by, similarity)
        chi2 = innovation_chi2(guess, self._with_drift(covariance, a, b), done.T_a_b, done.covariance)
        refused = done.refused or self._gate(chi2, self._closure.gate_chi2)
        event = CheckDone(
            stamp_ns, a, b, scan.points, done.submap, guess, done.T_a_b, done.inlier_ratio, done.second_peak
        )
        return [event, self._decide(proposal, refused)]

    def _with_drift(self, covariance: Floats, a: int, b: int) -> Floats:
        """The estimate's (3, 3) covariance of T_a_b, and what its factors leave out: drift that adds up one way."""
        path_m = abs(self._keyframes.paths_m[b] - self._keyframes.paths_m[a])
        drift = np.array([self._closure.drift, self._closure.drift, self._closure.drift_rad_per_m]) * path_m
        return covariance + np.diag(drift**2)

    def _lidar_proposal(self, a: int, b: int, done: Check, proposed_by: str, similarity: float) -> _Proposal:
        return _Proposal(
            a, b, self._keyframes[a].point.stamp_ns, self._keyframes[b].point.stamp_ns, ClosureKind.LIDAR, proposed_by,
            similarity, done.T_a_b, done.covariance, True, done.residual_m, done.inlier_ratio,
        )  # fmt: skip

    def _judge_wifi(self, candidate: WifiCandidate, poses: Floats) -> list[Event]:
        proposal = self._wifi_proposal(candidate, poses)
        predicted = Pose2.of(poses[proposal.a]).between(Pose2.of(poses[proposal.b]))
        covariance = self._graph.relative_covariance(proposal.a, proposal.b)
        if proposal.heading_claimed:
            chi2 = innovation_chi2(predicted, covariance, proposal.T_a_b, proposal.covariance)
            refused = self._gate(chi2, self._closure.gate_chi2)
        else:
            chi2 = position_chi2(predicted, covariance, proposal.T_a_b, proposal.covariance)
            refused = self._gate(chi2, self._closure.gate_chi2_position)
        return [self._decide(proposal, refused), *self._leave_wrong_mode(proposal.stamp_b_ns)]

    def _wifi_proposal(self, candidate: WifiCandidate, poses: Floats) -> _Proposal:
        a, b = candidate.a, candidate.b
        common = (
            a.keyframe, b.keyframe, self._keyframes[a.keyframe].point.stamp_ns,
            self._keyframes[b.keyframe].point.stamp_ns, ClosureKind.WIFI,
        )  # fmt: skip
        if candidate.sequence is not None:
            fit = candidate.sequence
            return _Proposal(
                *common, "sequence", candidate.similarity, fit.T_a_b, fit.covariance, True, fit.residual_m, np.nan
            )
        T = self._same_place(a, b, poses)
        variance = self._wifi.sigma_m**2
        covariance = np.diag([variance, variance, UNCLAIMED_RAD**2])
        return _Proposal(*common, "fingerprint", candidate.similarity, T, covariance, False, np.nan, np.nan)

    @staticmethod
    def _same_place(a: Fingerprint, b: Fingerprint, poses: Floats) -> Pose2:
        """T_a_b of the keyframes if both fingerprints stand at one place, the headings being as believed now."""
        turn = Pose2.of(poses[a.keyframe]).between(Pose2.of(poses[b.keyframe])).theta
        offset = Pose2(0.0, 0.0, turn).transform(np.array([[b.T_keyframe_base.x, b.T_keyframe_base.y]]))[0]
        return Pose2(a.T_keyframe_base.x - offset[0], a.T_keyframe_base.y - offset[1], turn)

    @staticmethod
    def _gate(chi2: float, limit: float) -> str:
        return f"contradicts the estimate: chi2 {chi2:.1f} over {limit}" if chi2 > limit else ""

    def _decide(self, p: _Proposal, refused: str) -> ClosureJudged:
        verdict = Verdict.REFUSED if refused else Verdict.ACCEPTED
        judged = ClosureJudged(
            len(self._judged), p.stamp_a_ns, p.stamp_b_ns, p.a, p.b, p.kind, p.proposed_by, p.similarity, p.residual_m,
            p.inlier_ratio, p.T_a_b, p.covariance, p.heading_claimed, verdict, refused or "agrees with the estimate",
        )  # fmt: skip
        self._judged.append(judged)
        if not refused:
            self._believe(judged)
        return judged

    def _believe(self, judged: ClosureJudged) -> None:
        factor = Between(judged.keyframe_a, judged.keyframe_b, judged.T_a_b, judged.covariance)
        self._accepted[judged.closure] = self._graph.add(factor)

    def _change(self, number: int, verdict: Verdict, reason: str) -> ClosureJudged:
        """The candidate `number` with a new verdict."""
        old = self._judged[number]
        judged = ClosureJudged(
            old.closure, old.stamp_a_ns, old.stamp_b_ns, old.keyframe_a, old.keyframe_b, old.kind, old.proposed_by,
            old.similarity, old.residual_m, old.inlier_ratio, old.T_a_b, old.covariance, old.heading_claimed, verdict,
            reason,
        )  # fmt: skip
        self._judged[number] = judged
        return judged

    def _sequence_event(self, candidate: WifiCandidate, stamp_ns: int, poses: Floats) -> list[Event]:
        a, b = candidate.a, candidate.b
        if candidate.sequence is None:
            return []
        fit = candidate.sequence
        T_map_a, T_map_b = Pose2.of(poses[a.keyframe]), Pose2.of(poses[b.keyframe])
        return [
            SequenceMatched(
                stamp_ns,
                a.keyframe,
                b.keyframe,
                T_map_a.transform(fit.points_a),
                T_map_b.transform(fit.points_b),
                fit.residual_m,
            )
        ]

    def _leave_wrong_mode(self, stamp_ns: int) -> list[Event]:
        """Where another turn bias explains the WiFi closures far better, start again from it."""
        wifi = [j for j in self._judged if j.kind is ClosureKind.WIFI]
        if len(wifi) < 3:
            return []
        pairs = np.array([(j.keyframe_a, j.keyframe_b) for j in wifi])
        mode = self._best_mode(pairs)
        now = cost_of(self._graph.poses(), pairs, self._keyframes.paths_m, self._wifi.sigma_m, self._search)
        if mode.cost > float(np.minimum(now, self._search.outlier_chi2).sum()) - self._search.min_gain:
            return []
        return [
            Warned(
                stamp_ns, f"the wheels' turn bias is taken to be {mode.values[2]:+.4f} rad/m: it explains the closures"
            ),
            *self._start_from(mode, wifi),
        ]

    def _best_mode(self, pairs: np.ndarray) -> Mode:
        wheels = self._graph.wheels()
        motions = np.array([(*w.motion.pose.array(), w.motion.path_m, w.motion.seconds) for w in wheels])
        return best_mode(motions, pairs, self._keyframes.paths_m, self._wifi.sigma_m, self._prior, self._search)

    def _start_from(self, mode: Mode, wifi: list[ClosureJudged]) -> list[Event]:
        events: list[Event] = []
        for judged, explained in zip(wifi, mode.explained, strict=True):
            believed = judged.closure in self._accepted
            if believed and not explained:
                self._graph.remove(self._accepted.pop(judged.closure))
                events.append(self._change(judged.closure, Verdict.REMOVED, "another turn bias explains more closures"))
            elif explained and not believed:
                changed = self._change(judged.closure, Verdict.ACCEPTED, "explained by the turn bias found")
                self._believe(changed)
                events.append(changed)
        self._graph.rebuild(mode.values, mode.poses)
        self.restarted = True
        return events
