"""Poses from outside, of a fiducial, a dock or a surveyor, as closures with the keyframe that defines the map's frame.

A fix is a claim like any other: one that contradicts the estimate is refused. Where several that were refused agree
with each other, over some metres of path, the estimate was wrong, and they are taken after all. But if no fix has ever
agreed, it is their frame that differs: a drive without a map begins a frame of its own at its first pose.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from wayfi.backend.graph.factors import BetweenFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.pose2 import Floats, Pose2, covariance_in_b, diagonal_covariance
from wayfi.frontends.closures.closure_config import ClosureConfig
from wayfi.frontends.closures.lidar_check import Expected, innovation_chi2
from wayfi.frontends.closures.verdicts import Verdicts
from wayfi.frontends.events import ClosureJudged, ClosureKind, Dropped, DropReason, Event, Verdict, Warned
from wayfi.frontends.keyframes import Keyframes
from wayfi.frontends.measurements import Sensor

MOST_WAITING = 100  # fixes, while the graph begins anew: they are one a keyframe
CLAIMED_RAD = 1.0  # a heading that is known no better is not claimed


@dataclass(frozen=True, slots=True, eq=False)
class OutsideFix:
    """The pose of base_link in `map` from outside, taken at `T_k_base` of its keyframe.

    `covariance` (3, 3) is in (x, y, theta) of `map`, m and rad; None where it is not known.
    """

    T_map_base: Pose2
    covariance: Floats | None
    T_k_base: Pose2


@dataclass(frozen=True, slots=True, eq=False)
class _Fix:
    """A fix of `keyframe` by its pose in keyframe 0, with its (3, 3) covariance in the axes of that."""

    stamp_ns: int
    keyframe: int
    T_0_k: Pose2
    covariance: Floats


class FixCloser:
    """Adds factors to the graph for fixes that agree with the estimate, and removes those that it contradicts."""

    def __init__(self, graph: PoseGraph, keyframes: Keyframes, verdicts: Verdicts, config: ClosureConfig) -> None:
        self._graph, self._keyframes, self._verdicts, self._config = graph, keyframes, verdicts, config
        self._waiting: deque[_Fix] = deque(maxlen=MOST_WAITING)
        self._accepted: dict[int, int] = {}
        self._refused: dict[int, _Fix] = {}
        self._fixes: dict[int, _Fix] = {}
        self._fixed = {0}
        self._agreed_once = self._told = False

    def add(self, stamp_ns: int, keyframe: int, fix: OutsideFix, poses: Floats) -> list[Event]:
        """Judge a fix of `keyframe` by the estimate of the keyframes' `poses` (n, 3), once that is not to be replaced.

        One for a keyframe is enough, and the first keyframe is where it is by definition: those are dropped.
        """
        if keyframe in self._fixed:
            return [Dropped(Sensor.FIX, stamp_ns, DropReason.ADDS_NOTHING)]
        self._fixed.add(keyframe)
        covariance = fix.covariance
        if covariance is None:
            covariance = diagonal_covariance(self._config.fixes.sigma_m, self._config.fixes.sigma_rad)
        T_map_k = fix.T_map_base @ fix.T_k_base.inverse()
        lever = np.eye(3)
        lever[0, 2], lever[1, 2] = fix.T_map_base.y - T_map_k.y, T_map_k.x - fix.T_map_base.x
        at_k = lever @ covariance @ lever.T
        at_k += diagonal_covariance(self._config.sigma_floor_m, self._config.sigma_floor_rad)
        first = Pose2.of(poses[0])
        self._waiting.append(_Fix(stamp_ns, keyframe, first.between(T_map_k), covariance_in_b(at_k, first.theta)))
        return self.judge(poses)

    def judge(self, poses: Floats) -> list[Event]:
        """Judge what waits, as `add` does."""
        events: list[Event] = []
        while self._waiting and not self._graph.restarts:
            events += self._judge(self._waiting.popleft(), poses)
        return events

    def factors(self) -> dict[int, tuple[int, ...]]:
        """The number of the factor of each accepted fix, by that of its verdict."""
        return {closure: (factor,) for closure, factor in self._accepted.items()}

    def release(self, closure: int) -> bool:
        """Give up the factor of an accepted fix, which was vetoed; False where it is none."""
        return self._accepted.pop(closure, None) is not None

    def take_back(self, closure: int, factors: tuple[int, ...]) -> bool:
        """Take a fix back that was restored, with its factors; False where it is none."""
        if closure not in self._fixes:
            return False
        (self._accepted[closure],) = factors
        return True

    def review(self, poses: Floats) -> list[Event]:
        """Remove that of the newest accepted fixes which the estimate contradicts most, if it does."""
        if self._graph.restarts:
            return []
        newest = sorted(self._accepted)[-self._config.reviewed :]
        chi2 = {number: self._off(self._fixes[number], poses) for number in newest}
        worst = max(chi2, key=lambda number: chi2[number], default=-1)
        if worst < 0 or chi2[worst] <= self._config.remove_chi2:
            return []
        self._graph.remove(self._accepted.pop(worst))
        reason = f"the estimate moved {chi2[worst]:.0f} chi2 away from it"
        return [self._verdicts.change(worst, Verdict.REMOVED, reason)]

    def _judge(self, fix: _Fix, poses: Floats) -> list[Event]:
        expected = self._expected(0, fix.keyframe, poses)
        chi2 = innovation_chi2(expected, fix.T_0_k, fix.covariance)
        gate = self._config.gate_chi2
        refused = "" if chi2 <= gate else f"contradicts the estimate: chi2 {chi2:.1f} over {gate:g}"
        judged = self._enter(fix, expected.T_a_b, refused)
        self._fixes[judged.closure] = fix
        if not refused:
            self._agreed_once = True
            self._accept(judged.closure)
            return [judged]
        self._refused[judged.closure] = fix
        while len(self._refused) > self._config.fixes.compared:
            self._refused.pop(min(self._refused))
        return [judged, *self._open_gate(judged.closure, poses)]

    def _open_gate(self, newest: int, poses: Floats) -> list[Event]:
        """Accept the refused fixes that agree with the newest, if they are enough; or tell that their frame differs."""
        agreeing = [n for n, fix in self._refused.items() if n == newest or self._agree(fix, self._refused[newest])]
        path_m = self._keyframes.paths_m[[self._refused[n].keyframe for n in agreeing]]
        fixes = self._config.fixes
        if len(agreeing) < fixes.agreeing or path_m.max() - path_m.min() < fixes.spread_m:
            return []
        if not self._agreed_once:
            return self._tell_frame(self._refused[newest], len(agreeing), poses)
        for number in agreeing:
            del self._refused[number]
            self._accept(number)
        reason = f"agrees with {len(agreeing) - 1} other fixes, and not with the estimate"
        return [self._verdicts.change(number, Verdict.ACCEPTED, reason) for number in agreeing]

    def _tell_frame(self, fix: _Fix, agreeing: int, poses: Floats) -> list[Event]:
        if self._told:
            return []
        self._told = True
        T = fix.T_0_k @ Pose2.of(poses[fix.keyframe]).inverse() @ Pose2.of(poses[0])
        text = (
            f"fixes: {agreeing} agree with each other and not with the map, whose frame they put at {T.x:.1f} m, "
            f"{T.y:.1f} m, {math.degrees(T.theta):.0f} degrees of theirs; they are not used: go on with a map that was "
            "put into their frame (wayfi align)"
        )
        return [Warned(fix.stamp_ns, text)]

    def _agree(self, one: _Fix, other: _Fix) -> bool:
        """Whether the wheels lead from one fix to the other: the estimate may be bent by what the fixes contradict."""
        motion = self._keyframes[one.keyframe].point.motion_to(self._keyframes[other.keyframe].point)
        fixes, T = self._config.fixes, one.T_0_k.between(other.T_0_k)
        driven = diagonal_covariance(fixes.wheels * motion.path_m, fixes.wheels_rad_per_m * motion.path_m)
        expected = Expected(motion.corrected(self._graph.calibration_values()), driven)
        of_one, of_other = (covariance_in_b(fix.covariance, one.T_0_k.theta) for fix in (one, other))
        lever = np.eye(3)
        lever[0, 2], lever[1, 2] = T.y, -T.x
        return innovation_chi2(expected, T, lever @ of_one @ lever.T + of_other) <= self._config.gate_chi2

    def _expected(self, a: int, b: int, poses: Floats) -> Expected:
        """T_a_b by the estimate, its covariance with what scan matching errs one way."""
        path_m = abs(self._keyframes.paths_m[b] - self._keyframes.paths_m[a])
        per_m = np.array([self._config.drift, self._config.drift, self._config.drift_rad_per_m])
        covariance = self._graph.relative_covariance(a, b) + np.diag((per_m * path_m) ** 2)
        return Expected(Pose2.of(poses[a]).between(Pose2.of(poses[b])), covariance)

    def _off(self, fix: _Fix, poses: Floats) -> float:
        """Squared Mahalanobis distance of a fix from the estimate, by its own covariance."""
        T = Pose2.of(poses[0]).between(Pose2.of(poses[fix.keyframe]))
        return innovation_chi2(Expected(T, np.zeros((3, 3))), fix.T_0_k, fix.covariance)

    def _accept(self, closure: int) -> None:
        fix = self._fixes[closure]
        self._accepted[closure] = self._graph.add(BetweenFactor(0, fix.keyframe, fix.T_0_k, fix.covariance))

    def _enter(self, fix: _Fix, expected: Pose2, refused: str) -> ClosureJudged:
        first, here = self._keyframes[0].point.stamp_ns, self._keyframes[fix.keyframe].point.stamp_ns
        claimed = bool(fix.covariance[2, 2] < CLAIMED_RAD**2)
        verdict = Verdict.REFUSED if refused else Verdict.ACCEPTED
        return self._verdicts.enter(ClosureJudged(
            0, first, here, 0, fix.keyframe, ClosureKind.FIX, "outside", np.nan, expected.distance(fix.T_0_k), np.nan,
            fix.T_0_k, fix.covariance, claimed, verdict, refused or "agrees with the estimate",
        ))  # fmt: skip
