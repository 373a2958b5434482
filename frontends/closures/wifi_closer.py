"""From WiFi's pairs of places to factors: none is believed for itself, and each can be taken back.

A pair is believed where the estimate makes it likely. Pairs that it does not make likely gather until another turn bias
of the wheels explains them much better; then everything starts again from that bias. So neither the order in which
pairs come nor a run of false ones decides.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.factors import NearFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.pose2 import Floats, Pose2, pose_of_common_place
from wayfi.frontends.closures.consensus import (
    ConsensusConfig,
    Hypothesis,
    Pairs,
    best_hypothesis,
    driven_area,
    likelihood_ratio,
    weigh,
)
from wayfi.frontends.closures.verdicts import Verdicts
from wayfi.frontends.events import ClosureJudged, ClosureKind, Event, SequenceMatched, Verdict, Warned
from wayfi.frontends.keyframes import Keyframes
from wayfi.frontends.wifi.wifi import WifiCandidate, WifiConfig

UNCLAIMED_RAD = 30.0  # a sigma that says nothing of a heading
_SHOWN = 40  # pairs of a sequence
_PRIOR_PAIRS = 50.0  # that the self-similarity's sigma counts for, against what accepted pairs show
_MORE_REFUSED = 1.2  # times as many as at the last search: another is worth its cost


@dataclass(slots=True)
class _Claim:
    """A pair with its verdict's number, and the number of its factor while it is believed.

    `gap_m` of path lie between it and the pair before it that relates the same two stretches.
    """

    number: int
    candidate: WifiCandidate
    gap_m: float
    factor: int | None = None
    confirmed: bool = False


class WifiCloser:
    """Judges WiFi's candidates among each other and against the estimate."""

    def __init__(
        self,
        graph: PoseGraph,
        keyframes: Keyframes,
        verdicts: Verdicts,
        prior: WheelCalibration,
        config: ConsensusConfig,
        wifi: WifiConfig,
        confirm: Callable[[WifiCandidate], None],
    ) -> None:
        self._graph, self._keyframes, self._verdicts = graph, keyframes, verdicts
        self._prior, self._config, self._wifi = prior, config, wifi
        self._confirm = confirm
        self._claims: list[_Claim] = []
        self._sequence: deque[_Claim] = deque(maxlen=_SHOWN)
        self._refused = self._searched_with = 0
        self._sigma_scale = 1.0

    def judge(self, candidate: WifiCandidate, stamp_ns: int, poses: Floats) -> list[Event]:
        """The first verdict on a candidate, in an estimate of keyframes at `poses` (n, 3)."""
        if not candidate.mutual:
            return [self._enter(candidate, poses, "the earlier place sounds more like another one beside the later")]
        claim = _Claim(len(self._verdicts), candidate, self._gap_m(candidate))
        self._claims.append(claim)
        self._refused += 1
        if claim.gap_m >= self._wifi.independent_m:
            self._sequence.clear()
        self._sequence.append(claim)
        shown = self._shown(stamp_ns, poses)
        judged = self._enter(candidate, poses, "the estimate does not make it likely")
        return [shown, self._believe_if_likely(claim, poses) or judged]

    def decide(self, stamp_ns: int, poses: Floats, last: bool = False) -> list[Event]:
        """Weigh the pairs together, once enough new ones were refused; `last`: nothing more will come.

        Start again from another turn bias if it explains them far better than the estimate does; otherwise believe
        what the estimate explains, if that is far better than chance.
        """
        self._searched_with = min(self._searched_with, self._refused)
        if self._graph.restarts or self._refused == 0:
            return []
        if (self._refused < _MORE_REFUSED * self._searched_with) and not last:
            return []
        self._searched_with = self._refused
        window = self._claims[-self._config.window :]
        pairs = self._pairs(window)
        gain = self._config.min_gain_at_end if last else self._config.min_gain
        found = best_hypothesis(self._motions(), pairs, self._prior, self._config)
        now, explained = weigh(poses, pairs, self._config.drift)
        if found.evidence >= now + gain:
            self._searched_with = 0
            text = f"the wheels' turn bias is taken to be {found.values[2]:+.4f} rad/m: it explains the closures"
            return [Warned(stamp_ns, text), *self._start_from(found, window)]
        if now < gain:
            return []
        agreed = explained & ~self._are_far(pairs, poses)
        return [
            self._believe(claim, poses, "agrees with the estimate, as others do")
            for claim, agrees in zip(window, agreed, strict=True)
            if agrees and claim.factor is None
        ]

    def review(self, poses: Floats) -> list[Event]:
        """After the estimate has moved: take back what it contradicts, believe what it now makes likely."""
        window = self._claims[-self._config.window :]
        if not window:
            return []
        pairs = self._pairs(window)
        far = self._are_far(pairs, poses)
        events: list[Event] = []
        for claim, is_far in zip(window, far, strict=True):
            if claim.factor is not None and is_far:
                events.append(self._take_back(claim, "the estimate puts its places apart after all"))
            elif claim.factor is None and not is_far and (judged := self._believe_if_likely(claim, poses)):
                events.append(judged)
        self._learn_sigma(window, pairs, poses)
        return events

    def _are_far(self, pairs: Pairs, poses: Floats) -> NDArray[np.bool_]:
        """(m,) whether the estimate puts the places of each pair too far apart to be one."""
        apart_m = np.hypot(*pairs.apart(poses).T)
        far: NDArray[np.bool_] = apart_m > np.minimum(
            self._config.max_apart_m, self._config.max_apart_sigmas * pairs.sigma_m
        )
        return far

    def _gap_m(self, candidate: WifiCandidate) -> float:
        """Path since the last pair that relates the same two stretches; no more than makes two pairs independent."""
        for claim in reversed(self._claims):
            gap_m = candidate.b.path_m - claim.candidate.b.path_m
            if gap_m >= self._wifi.independent_m:
                break
            if abs(candidate.a.path_m - claim.candidate.a.path_m) < self._wifi.independent_m:
                return max(gap_m, self._wifi.fingerprint_m)
        return self._wifi.independent_m

    def _believe_if_likely(self, claim: _Claim, poses: Floats) -> ClosureJudged | None:
        if self._graph.restarts:
            return None  # review looks again, in the estimate that comes of it
        posterior = self._posterior(claim, poses)
        if not posterior >= self._config.min_posterior:
            return None
        return self._believe(claim, poses, f"agrees with the estimate: {posterior:.1%} likely")

    def _posterior(self, claim: _Claim, poses: Floats) -> float:
        """How likely the pair is true, given the estimate with its covariance and how many pairs were true so far."""
        pair, a, b = self._pairs([claim]), claim.candidate.a, claim.candidate.b
        T_a_map = Pose2(0.0, 0.0, -poses[a.keyframe, 2])
        apart = T_a_map.transform(pair.apart(poses))[0]
        covariance = self._graph.place_covariance(a.keyframe, b.keyframe, b.place)
        covariance += pair.sigma_m[0] ** 2 * np.eye(2)
        if np.linalg.eigvalsh(covariance)[0] <= 0:
            return 0.0  # the estimate is so loose that rounding decides: it speaks for no pair
        chi2 = apart @ np.linalg.solve(covariance, apart)
        variance = np.sqrt(np.linalg.det(covariance))
        ratio = float(likelihood_ratio(chi2, variance, driven_area(poses)))
        window = self._claims[-self._config.window :]
        share = (1 + sum(other.factor is not None for other in window)) / (2 + len(window))
        return share * ratio / (share * ratio + 1 - share)

    def _start_from(self, found: Hypothesis, window: list[_Claim]) -> list[Event]:
        events: list[Event] = []
        for claim, explained in zip(window, found.explained, strict=True):
            if claim.factor is not None and not explained:
                events.append(self._take_back(claim, "another turn bias explains more closures"))
            elif explained and claim.factor is None:
                events.append(self._believe(claim, found.poses, "explained by the turn bias found"))
        self._graph.restart(found.values, found.poses)
        return events

    def _believe(self, claim: _Claim, poses: Floats, reason: str) -> ClosureJudged:
        """Make a factor of it; the verdict states the claim anew, with the heading of `poses` between the keyframes."""
        a, b = claim.candidate.a, claim.candidate.b
        independent = claim.gap_m / self._wifi.independent_m
        sigma_m = self._sigma_scale * claim.candidate.sigma_m / math.sqrt(independent)
        claim.factor = self._graph.add(NearFactor(a.keyframe, b.keyframe, a.place, b.place, sigma_m))
        self._refused -= 1
        if not claim.confirmed:
            self._confirm(claim.candidate)
            claim.confirmed = True
        T_a_b, covariance = self._claimed(claim.candidate, poses)
        refused = self._verdicts[claim.number]
        return self._verdicts.restate(
            replace(refused, T_a_b=T_a_b, covariance=covariance, verdict=Verdict.ACCEPTED, reason=reason)
        )

    def _take_back(self, claim: _Claim, reason: str) -> ClosureJudged:
        assert claim.factor is not None
        self._graph.remove(claim.factor)
        claim.factor = None
        self._refused += 1
        return self._verdicts.change(claim.number, Verdict.REMOVED, reason)

    def _learn_sigma(self, window: list[_Claim], pairs: Pairs, poses: Floats) -> None:
        """What accepted pairs show of the self-similarity's sigma, which counts as `_PRIOR_PAIRS` of them."""
        believed = np.array([claim.factor is not None for claim in window])
        sigmas = pairs.apart(poses)[believed] * (self._sigma_scale / pairs.sigma_m[believed, None])
        squared = 0.5 * float((sigmas**2).sum())
        self._sigma_scale = math.sqrt((_PRIOR_PAIRS + squared) / (_PRIOR_PAIRS + believed.sum()))

    def _pairs(self, claims: list[_Claim]) -> Pairs:
        a, b = [claim.candidate.a for claim in claims], [claim.candidate.b for claim in claims]
        return Pairs(
            np.array([f.keyframe for f in a]),
            np.array([f.keyframe for f in b]),
            np.array([f.place for f in a]),
            np.array([f.place for f in b]),
            self._sigma_scale * np.array([claim.candidate.sigma_m for claim in claims]),
            np.array([later.path_m - earlier.path_m for earlier, later in zip(a, b, strict=True)]),
            np.array([min(1.0, claim.gap_m / self._wifi.neighbouring_m) for claim in claims]),
        )

    def _motions(self) -> Floats:
        """(n, 5) what the wheels said between the keyframes."""
        wheels = self._graph.wheels()
        return np.array([(*w.motion.pose.array(), w.motion.path_m, w.motion.seconds) for w in wheels])

    def _shown(self, stamp_ns: int, poses: Floats) -> SequenceMatched:
        """The pairs in a row that relate the newest two stretches."""
        pairs = self._pairs(list(self._sequence))
        residual_m = float(np.hypot(*pairs.apart(poses).T).mean())
        return SequenceMatched(
            stamp_ns, int(pairs.a[-1]), int(pairs.b[-1]), pairs.at_a(poses), pairs.at_b(poses), residual_m
        )

    def _claimed(self, candidate: WifiCandidate, poses: Floats) -> tuple[Pose2, Floats]:
        """T_a_b of the keyframes if both fingerprints stand at one place, turned as `poses` are; its covariance."""
        a, b = candidate.a, candidate.b
        turned = Pose2.of(poses[a.keyframe]).between(Pose2.of(poses[b.keyframe])).theta
        variance = (self._sigma_scale * candidate.sigma_m) ** 2
        return pose_of_common_place(a.place, b.place, turned), np.diag([variance, variance, UNCLAIMED_RAD**2])

    def _enter(self, candidate: WifiCandidate, poses: Floats, refused: str) -> ClosureJudged:
        a, b = candidate.a, candidate.b
        at_a, at_b = (Pose2.of(poses[f.keyframe]) @ f.T_keyframe_base for f in (a, b))
        T_a_b, covariance = self._claimed(candidate, poses)
        proposed_by = "sequence" if candidate.mutual and len(self._sequence) > 1 else "fingerprint"
        return self._verdicts.enter(
            ClosureJudged(
                0, self._keyframes[a.keyframe].point.stamp_ns, self._keyframes[b.keyframe].point.stamp_ns, a.keyframe,
                b.keyframe, ClosureKind.WIFI, proposed_by, candidate.similarity, at_a.distance(at_b), np.nan, T_a_b,
                covariance, False, Verdict.REFUSED, refused,
            )
        )  # fmt: skip
