"""Judges WiFi's claims: accepts them as factors together, not one by one, and removes those that prove wrong.

A claim is accepted where the estimate makes it likely. Refused claims gather until another turn bias of the wheels
explains them much better than the estimate does; then everything starts again from that bias. So neither the order in
which claims come nor a run of false ones decides.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.factors import AxisFactor, BetweenFactor, NearFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.pose2 import Floats, Pose2, between_all, pose_of_common_place
from wayfi.frontends.axes.axis_headings import withdraw_axes
from wayfi.frontends.closures.closure_config import ConsensusConfig
from wayfi.frontends.closures.consensus import (
    Hypothesis,
    Pairs,
    best_hypothesis,
    driven_area,
    headings_of,
    likelihood_ratio,
    motions_of,
    weigh,
)
from wayfi.frontends.closures.lidar_check import Expected, update_by_place
from wayfi.frontends.closures.verdicts import Verdicts
from wayfi.frontends.closures.wifi_claims import Claim, WifiClaims
from wayfi.frontends.events import ClosureJudged, ClosureKind, Event, SequenceMatched, Verdict, Warned
from wayfi.frontends.keyframes import Keyframes
from wayfi.frontends.wifi.fingerprints import WifiCandidate
from wayfi.frontends.wifi.wifi_config import WifiConfig

JUDGED_AT_ONCE = 4  # claims, anew after the estimate has moved: each takes a covariance of 1 to 20 ms
UNCLAIMED_RAD = 30.0  # the sigma of a heading that is not claimed: five turns


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """A restart: the claims that it explains, and the calibrations (k, 4) and poses (n, 3) that it replaced."""

    claims: list[Claim]
    calibrations: Floats
    poses: Floats


class WifiCloser:
    """Judges WiFi's candidates together, and each against the estimate; `confirm` is called with every accepted one.

    `walls` gives what the laser saw of a candidate's two places, where that left the pose open along walls.
    """

    def __init__(
        self,
        graph: PoseGraph,
        keyframes: Keyframes,
        verdicts: Verdicts,
        prior: WheelCalibration,
        config: ConsensusConfig,
        wifi: WifiConfig,
        confirm: Callable[[WifiCandidate], None],
        walls: Callable[[WifiCandidate], BetweenFactor | None],
    ) -> None:
        self._graph, self._keyframes, self._verdicts = graph, keyframes, verdicts
        self._prior, self._config = prior, config
        self._confirm, self._walls = confirm, walls
        self.claims = WifiClaims(config, wifi)
        self._refused = self._searched_with = 0
        self._trial: _Trial | None = None
        self._to_judge: list[Claim] = []

    def judge(self, candidate: WifiCandidate, stamp_ns: int, poses: Floats) -> list[Event]:
        """The first verdict on a candidate, by the estimate of the keyframes' `poses` (n, 3)."""
        if not candidate.mutual:
            reason = "the earlier place sounds more like another one beside the later"
            return [self._enter(candidate, poses, "fingerprint", reason)]
        claim = self.claims.add(len(self._verdicts), candidate)
        self._refused += 1
        shown = self._shown(stamp_ns, poses)
        proposed_by = "sequence" if self.claims.continues(claim) else "fingerprint"
        judged = self._enter(candidate, poses, proposed_by, "the estimate does not make it likely")
        return [shown, self._accept_if_likely(claim, poses) or judged]

    def decide(self, stamp_ns: int, poses: Floats, last: bool = False) -> list[Event]:
        """Judge the claims together, once enough new ones were refused; `last`: no more will come.

        Starts again from another turn bias if that explains them far better than the estimate does; otherwise accepts
        what the estimate explains, if that is far better than chance. Before the first closure that may be further
        apart than a closure is accurate, since dead reckoning is.
        """
        if not self._search_due(last):
            return []
        recent = self.claims.recent()
        pairs = self.claims.pairs(recent)
        gain = self._config.min_gain_at_end if last else self._config.min_gain
        headings = headings_of(self._graph.of_kind(AxisFactor)[-self._config.window :], poses, self._config.no_axes)
        motions = motions_of(self._graph.of_kind(WheelFactor), len(poses) - 1)
        found = best_hypothesis(motions, self._matched(poses), pairs, headings, self._prior, self._config)
        now, explained = weigh(poses, pairs, self._config.drift)
        if found.evidence >= now + gain:
            if headings.contradict(found.poses[:, 2]):
                withdraw_axes(self._graph)
            text = f"the wheels' turn bias is estimated as {found.values[2]:+.4f} rad/m: it explains the closures"
            return [Warned(stamp_ns, text), *self._restart_from(found, recent, poses)]
        if now < gain:
            return []
        if any(claim.confirmed for claim in recent):
            explained &= ~self._are_far(pairs, poses)
        return [
            self._accept(claim, poses, "agrees with the estimate, as others do")
            for claim, agrees in zip(recent, explained, strict=True)
            if agrees and claim.factor is None
        ]

    def review(self, poses: Floats, last: bool = False) -> list[Event]:
        """After the estimate has changed: remove what it contradicts, and judge anew what it did not make likely.

        `go_on` judges what is left, unless this is the `last` review.
        """
        recent = self.claims.recent()
        if not recent or self._graph.restarts:
            return []
        pairs = self.claims.pairs(recent)
        far = self._are_far(pairs, poses)
        contradicted = [claim for claim, is_far in zip(recent, far, strict=True) if claim.factor is not None and is_far]
        events: list[Event] = [
            self._remove(claim, "the estimate puts its places apart after all") for claim in contradicted
        ]
        gone = {claim.number for claim in contradicted}
        open_ones = {claim.number: claim for claim in recent if claim.factor is None and claim.number not in gone}
        first = [claim for claim in self._to_judge if claim.number in open_ones]
        waiting = {claim.number for claim in first}
        self._to_judge = first + [claim for number, claim in open_ones.items() if number not in waiting]
        events += self.go_on(poses, len(self._to_judge) if last else JUDGED_AT_ONCE)
        events += self._end_trial()
        self.claims.learn_sigma(pairs, poses)
        return events

    def go_on(self, poses: Floats, at_most: int = JUDGED_AT_ONCE) -> list[Event]:
        """Judge anew the next of what `review` has left, and accept what is likely."""
        events: list[Event] = []
        if self._graph.restarts:
            return events
        judged = 0
        while self._to_judge and judged < at_most:
            claim = self._to_judge.pop(0)
            if claim.factor is None and not claim.vetoed and not self._are_far(self.claims.pairs([claim]), poses)[0]:
                judged += 1
                accepted = self._accept_if_likely(claim, poses)
                events += [accepted] if accepted else []
        return events

    def withdraw_walls(self) -> None:
        """Take back what the laser added to accepted claims."""
        for claim in self.claims.all():
            self._remove_walls(claim)

    def _remove_walls(self, claim: Claim) -> None:
        if claim.walls is not None:
            self._graph.remove(claim.walls)
            claim.walls = None

    def _search_due(self, last: bool) -> bool:
        """Whether there are refused claims, and enough new ones since the last search to be worth another."""
        self._searched_with = min(self._searched_with, self._refused)
        if self._graph.restarts or self._refused == 0:
            return False
        if self._refused < self._config.search_growth * self._searched_with and not last:
            return False
        self._searched_with = self._refused
        return True

    def _are_far(self, pairs: Pairs, poses: Floats) -> NDArray[np.bool_]:
        """(m,) whether the estimate puts the places of each claim too far apart to be one."""
        apart_m = np.hypot(*pairs.apart(poses).T)
        far: NDArray[np.bool_] = apart_m > np.minimum(
            self._config.max_apart_m, self._config.max_apart_sigmas * pairs.sigma_m
        )
        return far

    def _accept_if_likely(self, claim: Claim, poses: Floats) -> ClosureJudged | None:
        if self._graph.restarts:
            return None  # `review` judges it again by the estimate after the restart
        posterior = self._posterior(claim, poses)
        if not posterior >= self._config.min_posterior:
            return None
        return self._accept(claim, poses, f"agrees with the estimate: {posterior:.1%} likely")

    def _posterior(self, claim: Claim, poses: Floats) -> float:
        """The probability that a claim is true, given the estimate, its covariance, and the share of true claims."""
        pair, a, b = self.claims.pairs([claim]), claim.candidate.a, claim.candidate.b
        T_a_map = Pose2(0.0, 0.0, -poses[a.keyframe, 2])
        apart = T_a_map.transform(pair.apart(poses))[0]
        covariance = self._graph.place_covariance(a.keyframe, b.keyframe, pair.place_b[0])
        covariance += pair.sigma_m[0] ** 2 * np.eye(2)
        if np.linalg.eigvalsh(covariance)[0] <= 0:
            return 0.0  # by rounding, where the estimate is very loose: it supports no claim
        chi2 = apart @ np.linalg.solve(covariance, apart)
        variance = np.sqrt(np.linalg.det(covariance))
        ratio = float(likelihood_ratio(chi2, variance, driven_area(poses)))
        share = self.claims.true_share()
        return share * ratio / (share * ratio + 1 - share)

    def _restart_from(self, found: Hypothesis, claims: list[Claim], poses: Floats) -> list[Event]:
        """Accept the claims that `found` explains, remove the others, and restart the graph from it, on trial."""
        events: list[Event] = []
        for claim, explained in zip(claims, found.explained, strict=True):
            if claim.factor is not None and not explained:
                events.append(self._remove(claim, "another turn bias explains more closures"))
            elif explained and claim.factor is None:
                events.append(self._accept(claim, found.poses, "explained by the turn bias found"))
        explained = [claim for claim in claims if claim.factor is not None]
        self._trial = _Trial(explained, self._graph.calibrations(), poses)
        self._graph.restart(found.values, found.poses)
        return events

    def _end_trial(self) -> list[Event]:
        """Undo the last restart if the estimate that it led to has given up most of the claims that it explained."""
        trial = self._trial
        if trial is None or self._graph.restarts:
            return []
        if 2 * sum(claim.factor is not None for claim in trial.claims) >= len(trial.claims):
            return []
        self._trial = None
        self._graph.restart(trial.calibrations, trial.poses)
        held = [claim for claim in self.claims.recent() if claim.factor is not None]
        return [self._remove(claim, "the turn bias found did not hold") for claim in held]

    def _accept(self, claim: Claim, poses: Floats, reason: str) -> ClosureJudged:
        """Add its factor; the verdict states the claim anew, with the heading of `poses` between the keyframes."""
        a, b = claim.candidate.a, claim.candidate.b
        places = self.claims.places(claim.candidate)
        factor = NearFactor(a.keyframe, b.keyframe, *places, self.claims.factor_sigma_m(claim))
        claim.factor = self._graph.add(factor)
        walls = self._walls(claim.candidate)
        claim.walls = self._graph.add(walls) if walls else None
        self._refused -= 1
        if not claim.confirmed:
            self._confirm(claim.candidate)
            claim.confirmed = True
        T_a_b, covariance = self._claimed(claim.candidate, poses)
        refused = self._verdicts[claim.number]
        return self._verdicts.restate(replace(
            refused, T_a_b=T_a_b, covariance=covariance, heading_claimed=walls is not None, verdict=Verdict.ACCEPTED,
            reason=reason,
        ))  # fmt: skip

    def _remove(self, claim: Claim, reason: str) -> ClosureJudged:
        assert claim.factor is not None
        self._graph.remove(claim.factor)
        claim.factor = None
        self._remove_walls(claim)
        self._refused += 1
        return self._verdicts.change(claim.number, Verdict.REMOVED, reason)

    def _matched(self, poses: Floats) -> Floats:
        """(n, 3) the estimated steps between keyframes that scan matches or a map relate, NaN where none does."""
        known = self._graph.scan_matched()
        known[: self._keyframes.first] = True
        return np.where(known[:, None], between_all(poses[:-1], poses[1:]), np.nan)

    def _shown(self, stamp_ns: int, poses: Floats) -> SequenceMatched:
        """The claims in a row that relate the newest two stretches."""
        pairs = self.claims.pairs(self.claims.sequence())
        residual_m = float(np.hypot(*pairs.apart(poses).T).mean())
        return SequenceMatched(
            stamp_ns, int(pairs.a[-1]), int(pairs.b[-1]), pairs.at_a(poses), pairs.at_b(poses), residual_m
        )

    def _claimed(self, candidate: WifiCandidate, poses: Floats) -> tuple[Pose2, Floats]:
        """T_a_b of the keyframes if both fingerprints are at one place, with its covariance.

        The heading is that of walls that the laser saw, or of `poses` and then not claimed.
        """
        a, b = candidate.a, candidate.b
        places = self.claims.places(candidate)
        if walls := self._walls(candidate):
            known = Expected(walls.T_a_b, walls.covariance)
            updated, _ = update_by_place(known, *places, self.claims.sigma_m(candidate))
            return updated.T_a_b, updated.covariance
        heading = Pose2.of(poses[a.keyframe]).between(Pose2.of(poses[b.keyframe])).theta
        variance = self.claims.sigma_m(candidate) ** 2
        return pose_of_common_place(*places, heading), np.diag([variance, variance, UNCLAIMED_RAD**2])

    def _enter(self, candidate: WifiCandidate, poses: Floats, proposed_by: str, refused: str) -> ClosureJudged:
        a, b = candidate.a, candidate.b
        at_a, at_b = (Pose2.of(poses[f.keyframe]) @ f.T_keyframe_base for f in (a, b))
        T_a_b, covariance = self._claimed(candidate, poses)
        return self._verdicts.enter(
            ClosureJudged(
                0, self._keyframes[a.keyframe].point.stamp_ns, self._keyframes[b.keyframe].point.stamp_ns, a.keyframe,
                b.keyframe, ClosureKind.WIFI, proposed_by, candidate.similarity, at_a.distance(at_b), np.nan, T_a_b,
                covariance, self._walls(candidate) is not None, Verdict.REFUSED, refused,
            )
        )  # fmt: skip
