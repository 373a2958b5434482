"""Loop closures by the laser: candidates from the estimate and from WiFi, checked, and removed if they prove wrong."""

from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.graph.factors import BetweenFactor
from wayfi.backend.graph.health import position_sigma
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.variance_factor import VarianceFactor
from wayfi.backend.pose2 import Floats, Pose2, diagonal_covariance
from wayfi.frontends.closures.closure_config import ClosureConfig
from wayfi.frontends.closures.lidar_check import (
    CheckResult,
    Expected,
    check,
    innovation_chi2,
    nearest_candidate,
    update_by_place,
)
from wayfi.frontends.closures.lost_robot import LostRobotSearch
from wayfi.frontends.closures.verdicts import Verdicts
from wayfi.frontends.events import CheckDone, ClosureJudged, ClosureKind, Event, Verdict, Warned
from wayfi.frontends.keyframes import Keyframes
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.maps.continuing import MapFix
from wayfi.frontends.timer import Timer, untimed
from wayfi.frontends.wifi.fingerprints import WifiCandidate

MISPLACED = diagonal_covariance(0.5, 0.2)  # of a robot that was found by scans with a wrong mount or clock


@dataclass(frozen=True, slots=True)
class _Proposed:
    """Two keyframes that may be near each other, by the estimate, by WiFi, or by a search (`proposed_by`)."""

    a: int
    b: int
    proposed_by: str
    similarity: float = np.nan


@dataclass(frozen=True, slots=True, eq=False)
class CheckOutcome:
    """The result of checking a WiFi candidate: its `events`, and whether it was accepted (`closed`).

    `open`: it was not, and WiFi has more to say: the estimate is less certain of the relative position than WiFi is, or
    not much more and the laser sees walls that agree and leave the pose open along them.
    """

    events: list[Event]
    closed: bool = False
    open: bool = False


class LidarCloser:
    """Adds factors to the graph for candidates that pass the check, and removes those that the graph contradicts.

    `variance_factor` is what the accepted ones say of the graph's covariances.
    """

    def __init__(
        self,
        graph: PoseGraph,
        keyframes: Keyframes,
        verdicts: Verdicts,
        closure: ClosureConfig,
        lidar: LidarConfig,
        timer: Timer = untimed,
    ) -> None:
        self._graph, self._keyframes, self._verdicts = graph, keyframes, verdicts
        self._closure, self._lidar, self._timer = closure, lidar, timer
        self._accepted: dict[int, int] = {}
        self._vetoed: set[int] = set()
        self.variance_factor = VarianceFactor(closure.variance_prior)
        self._walls: dict[tuple[int, int], BetweenFactor] = {}
        self._last_check_m = -np.inf
        self._search = LostRobotSearch(keyframes, closure, lidar)

    def begin_with(self, factors: dict[int, tuple[int, ...]]) -> None:
        """Begin with the accepted closures of a map: the factor of each closure by its number."""
        self._accepted = {
            closure: numbers[0]
            for closure, numbers in factors.items()
            if numbers and self._verdicts[closure].kind is ClosureKind.LIDAR
        }

    def close_by_estimate(self, keyframe: int, stamp_ns: int, poses: Floats) -> list[Event]:
        """Check the newest keyframe against the nearest earlier one that the estimate offers."""
        here = self._keyframes[keyframe]
        if (
            self._graph.restarts
            or here.scan is None
            or here.point.path_m - self._last_check_m < self._closure.check_every_m
        ):
            return []
        keyframes = self._keyframes
        a = nearest_candidate(keyframe, poses, keyframes.paths_m, keyframes.reachable_scans, self._closure)
        if a is None:
            return []
        self._last_check_m = here.point.path_m
        if self._shortest_path_m(a, keyframe) < self._closure.closed_m or self._is_vetoed(a, keyframe):
            return []
        expected = self._expected(a, keyframe, poses)
        return self._close(_Proposed(a, keyframe, "estimate"), expected, stamp_ns, poses)

    def search_from(self, keyframe: int) -> None:
        """The robot was moved by an unknown way before `keyframe`: search the map for it."""
        self._search.begin(keyframe)

    def close_by_search(self, keyframe: int, stamp_ns: int, poses: Floats) -> list[Event]:
        """Go on with the search for a robot that was moved; two closures once it is found."""
        with self._timer("check"):
            found = self._search.search(keyframe, poses)
        events: list[Event] = []
        for f in found:
            T, fit = f.fit.result.T_target_scan, f.fit.result
            done = CheckResult(T, f.covariance, fit.inlier_ratio, fit.residual_m, np.nan, f.submap, "")
            expected = Pose2.of(poses[f.a]).between(Pose2.of(poses[f.b]))
            scan = self._keyframes[f.b].scan
            assert scan is not None
            events.append(CheckDone(stamp_ns, f.a, f.b, scan.points, f.submap, expected, T, fit.inlier_ratio, np.nan))
            events.append(self._enter(_Proposed(f.a, f.b, "search"), done, "two scans agree on this place alone"))
        if found:
            apart_m = Pose2.of(poses[keyframe]).distance(found[-1].placed(keyframe, poses))
            events.append(Warned(stamp_ns, f"the robot was found again, {apart_m:.1f} m from where the wheels put it"))
        return events

    def enter_fix(self, fix: MapFix) -> ClosureJudged:
        """Accept a closure that leads into the map that the drive goes on with, where it was found."""
        done = CheckResult(fix.T_a_b, fix.covariance, fix.inlier_ratio, fix.residual_m, np.nan, np.empty((0, 2)), "")
        return self._enter(_Proposed(fix.a, fix.b, "map"), done, "found in the map")

    def can_check(self, candidate: WifiCandidate) -> bool:
        """Whether a WiFi candidate can be checked: its keyframes differ, both have a scan, and the estimate stays."""
        a, b = candidate.a.keyframe, candidate.b.keyframe
        return (
            not self._graph.restarts
            and a != b
            and self._keyframes[a].scan is not None
            and self._keyframes[b].scan is not None
        )

    def close_by_wifi(self, candidate: WifiCandidate, stamp_ns: int, poses: Floats) -> CheckOutcome:
        """Check a WiFi candidate that `can_check` admits.

        One whose keyframes are already near each other along the path and the closures gets no verdict.
        """
        a, b = candidate.a, candidate.b
        near = self._shortest_path_m(a.keyframe, b.keyframe) < self._closure.closed_m
        if near or self._is_vetoed(a.keyframe, b.keyframe):
            return CheckOutcome([])
        expected = self._expected(a.keyframe, b.keyframe, poses)
        known_m = position_sigma(expected.covariance)
        is_open = known_m > candidate.sigma_m
        updated, chi2 = update_by_place(expected, a.place, b.place, candidate.sigma_m)
        proposed = _Proposed(a.keyframe, b.keyframe, "wifi", candidate.similarity)
        if chi2 > self._closure.gate_chi2:
            why = f"WiFi contradicts the estimate: chi2 {chi2:.1f} over {self._closure.gate_chi2}"
            return CheckOutcome([self._enter(proposed, _unchecked(updated, why))], open=is_open)
        events = self._close(proposed, updated, stamp_ns, poses)
        closed = any(isinstance(event, ClosureJudged) and event.verdict is Verdict.ACCEPTED for event in events)
        by_walls = known_m > self._closure.walls_above * candidate.sigma_m and self.walls(candidate) is not None
        return CheckOutcome(events, closed, not closed and (is_open or by_walls))

    def walls(self, candidate: WifiCandidate) -> BetweenFactor | None:
        """The pose across and along the heading of the walls that both keyframes of a checked candidate see.

        Along the walls it is open. None where the check found no such walls, or fixed the pose by itself.
        """
        return self._walls.get((candidate.a.keyframe, candidate.b.keyframe))

    def factors(self) -> dict[int, tuple[int, ...]]:
        """The number of the factor of each accepted closure."""
        return {closure: (factor,) for closure, factor in self._accepted.items()}

    def release(self, closure: int) -> bool:
        """Give up the factor of a closure that was vetoed, and propose none like it; False where it is none."""
        if self._accepted.pop(closure, None) is None:
            return False
        self._vetoed.add(closure)
        return True

    def take_back(self, closure: int, factors: tuple[int, ...]) -> bool:
        """Take a closure back that was restored, with its factors; False where it is none that was vetoed."""
        if closure not in self._vetoed:
            return False
        self._vetoed.remove(closure)
        (self._accepted[closure],) = factors
        return True

    def review(self, poses: Floats) -> list[Event]:
        """Remove those of the newest accepted closures that the estimate contradicts, unless it is being replaced."""
        events: list[Event] = []
        if self._graph.restarts:
            return events
        for number in sorted(self._accepted)[-self._closure.reviewed :]:
            judged = self._verdicts[number]
            T = Pose2.of(poses[judged.keyframe_a]).between(Pose2.of(poses[judged.keyframe_b]))
            chi2 = innovation_chi2(Expected(T, np.zeros((3, 3))), judged.T_a_b, judged.covariance)
            if chi2 > self._closure.remove_chi2:
                self._graph.remove(self._accepted.pop(number))
                reason = f"the estimate moved {chi2:.0f} chi2 away from it"
                events.append(self._verdicts.change(number, Verdict.REMOVED, reason))
        return events

    def withdraw(self, reason: str) -> list[Event]:
        """Remove the drive's own closures, for `reason`, and forget what scans said: they are forgotten themselves.

        The place where it was found in a map is all that holds it there: that is known less exactly from now on.
        """
        self._search.scans_forgotten()
        self._walls.clear()
        self._vetoed = {number for number in self._vetoed if not self._is_own(number)}
        own = [number for number in sorted(self._accepted) if self._is_own(number)]
        return [self._withdraw(number, reason) for number in own]

    def _is_own(self, number: int) -> bool:
        """Whether a closure is of the drive, not of the map that it goes on with."""
        return self._verdicts[number].keyframe_b >= self._keyframes.first

    def _withdraw(self, number: int, reason: str) -> ClosureJudged:
        judged = self._verdicts[number]
        if judged.proposed_by != "map":
            self._graph.remove(self._accepted.pop(number))
            return self._verdicts.change(number, Verdict.REMOVED, reason)
        looser = replace(judged, covariance=judged.covariance + MISPLACED)
        factor = BetweenFactor(judged.keyframe_a, judged.keyframe_b, judged.T_a_b, looser.covariance)
        self._graph.substitute(self._accepted[number], factor)
        return self._verdicts.restate(looser)

    def _close(self, proposed: _Proposed, expected: Expected, stamp_ns: int, poses: Floats) -> list[Event]:
        a, b = proposed.a, proposed.b
        reach = self._closure.submap_reach
        first, last = self._keyframes.piece(a)
        first, last = max(a - reach, first), min(a + reach + 1, b, last)
        scans, placed = self._keyframes.scans_around(first, last, poses[a], poses)
        scan = self._keyframes[b].scan
        assert scan is not None
        with self._timer("check"):
            done = check(scan, scans, placed, expected, self._closure, self._lidar)
        if done is None:
            return [self._enter(proposed, _unchecked(expected, "too few points to check"))]
        if not done.refused and proposed.proposed_by == "estimate":
            claimed = Expected(expected.T_a_b, expected.covariance - self._drift(a, b))
            self.variance_factor.add(innovation_chi2(claimed, done.T_a_b, done.covariance))
        shown = CheckDone(
            stamp_ns, a, b, scan.points, done.submap, expected.T_a_b, done.T_a_b, done.inlier_ratio, done.second_peak
        )
        return [shown, self._enter(proposed, done)]

    def _expected(self, a: int, b: int, poses: Floats) -> Expected:
        """T_a_b by the estimate; its covariance includes systematic drift, which the graph's factors leave out."""
        covariance = self._graph.relative_covariance(a, b) + self._drift(a, b)
        return Expected(Pose2.of(poses[a]).between(Pose2.of(poses[b])), covariance)

    def _drift(self, a: int, b: int) -> Floats:
        """(3, 3) covariance of what scan matching errs one way between two keyframes."""
        per_m = np.array([self._closure.drift, self._closure.drift, self._closure.drift_rad_per_m])
        return np.diag((per_m * self._shortest_path_m(a, b)) ** 2)

    def _shortest_path_m(self, a: int, b: int) -> float:
        """The shortest path (m) from keyframe a to b: the driven one, or one over one of the newest closures."""
        path = self._keyframes.paths_m
        closures = [self._verdicts[number] for number in list(self._accepted)[-self._closure.reviewed :]]
        over_closures = [abs(path[c.keyframe_a] - path[a]) + abs(path[b] - path[c.keyframe_b]) for c in closures]
        return float(min([abs(path[b] - path[a]), *over_closures]))

    def _is_vetoed(self, a: int, b: int) -> bool:
        """Whether a closure that was vetoed relates the same two stretches of path."""
        path, near_m = self._keyframes.paths_m, self._closure.closed_m
        vetoed = (self._verdicts[number] for number in self._vetoed)
        return any(
            abs(path[v.keyframe_a] - path[a]) < near_m and abs(path[v.keyframe_b] - path[b]) < near_m for v in vetoed
        )

    def _enter(self, p: _Proposed, done: CheckResult, why: str = "agrees with the estimate") -> ClosureJudged:
        """Enter the verdict on a candidate; add its factor if it is accepted."""
        refused = done.refused
        verdict = Verdict.REFUSED if refused else Verdict.ACCEPTED
        if done.walls_agree:
            self._walls[p.a, p.b] = BetweenFactor(p.a, p.b, done.T_a_b, done.covariance)
        judged = self._verdicts.enter(ClosureJudged(
            0, self._keyframes[p.a].point.stamp_ns, self._keyframes[p.b].point.stamp_ns, p.a, p.b, ClosureKind.LIDAR,
            p.proposed_by, p.similarity, done.residual_m, done.inlier_ratio, done.T_a_b, done.covariance, True, verdict,
            refused or why,
        ))  # fmt: skip
        if not refused:
            self._search.closed(p.a, p.b)
            self._accepted[judged.closure] = self._graph.add(BetweenFactor(p.a, p.b, done.T_a_b, done.covariance))
        return judged


def _unchecked(expected: Expected, why: str) -> CheckResult:
    """The check of a candidate that is refused before its scans are compared."""
    return CheckResult(expected.T_a_b, expected.covariance, np.nan, np.nan, np.nan, np.empty((0, 2)), why)
