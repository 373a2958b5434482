"""The union of two maps of one building, by what relates their keyframes.

Another drive has other wheels: what a wheel factor says is put into metres by the calibration of its own drive. The
last keyframe of one map and the first of the other are related by a factor so loose that it says nothing, which keeps
the graph in one piece whatever is vetoed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.graph.factors import AxisFactor, BetweenFactor, Factor, NearFactor
from wayfi.backend.pose2 import Floats, Pose2, compose_all, diagonal_covariance
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import ClosureJudged, ClosureKind, Verdict
from wayfi.frontends.maps.building_map import BuildingMap, MapClosure, MapFingerprint
from wayfi.frontends.maps.continuing import calibrated_factors
from wayfi.frontends.maps.optimising import OptimisingConfig, optimise
from wayfi.frontends.wifi.receivers import ReceiverOffset

LOOSE = diagonal_covariance(1e4, 1e2)  # 10 km and 16 turns


@dataclass(frozen=True, slots=True, eq=False)
class Tie:
    """What relates keyframe `factor.a` of one map to keyframe `factor.b` of another, as a closure of their union.

    `T_a_b` and its (3, 3) covariance are what the closure claims; `similarity`, `inlier_ratio` and `residual_m` tell
    how it was found, NaN where they do not apply.
    """

    factor: BetweenFactor | NearFactor
    T_a_b: Pose2
    covariance: Floats
    reason: str
    similarity: float = np.nan
    inlier_ratio: float = np.nan
    residual_m: float = np.nan


def join(
    a: BuildingMap,
    b: BuildingMap,
    T_a_b: Pose2,
    ties: Sequence[Tie],
    config: OptimisingConfig,
    floors: Mapping[int, int] | None = None,
) -> BuildingMap:
    """One map of both, in the frame of `a`, optimised; its sessions, keyframes and closures are those of a, then of b.

    `T_a_b` is the pose of the frame of `b` in that of `a`, from which the optimisation starts; `floors` are the new
    numbers of the floors of `b`, which keep theirs without. Raises OptimisingError.
    """
    floors = floors or {}
    keyframes, factors = len(a.keyframes), calibrated_factors(a)
    sessions = 1 + max((k.session for k in a.keyframes), default=-1)
    seam = max(factors, default=-1) + 1
    first = seam + 1
    of_b = {first + number: _moved(factor, keyframes, _wings(a)) for number, factor in calibrated_factors(b).items()}
    poses_b = compose_all(T_a_b.array(), b.poses)
    last_to_first = Pose2.of(a.poses[-1]).between(Pose2.of(poses_b[0]))
    factors |= {seam: BetweenFactor(keyframes - 1, keyframes, last_to_first, LOOSE), **of_b}
    tie = max(factors) + 1
    factors |= {tie + n: replace(t.factor, b=t.factor.b + keyframes) for n, t in enumerate(ties)}
    closures = [*a.closures, *(_moved_closure(c, keyframes, len(a.closures), first) for c in b.closures)]
    closures += [MapClosure(_judged(len(closures) + n, t, a, b), (tie + n,)) for n, t in enumerate(ties)]
    joined = BuildingMap(
        [
            *a.keyframes,
            *(replace(k, session=k.session + sessions, floor=floors.get(k.floor, k.floor)) for k in b.keyframes),
        ],
        np.concatenate([a.poses, poses_b]),
        np.concatenate([a.calibrations, b.calibrations]),
        factors,
        closures,
        [*a.fingerprints, *(_moved_fingerprint(f, keyframes) for f in b.fingerprints)],
        joined_weights(a.weights, b.weights),
        Calibration(a.calibration.wheels, joined_receivers(a.calibration.receivers, b.calibration.receivers)),
        a.grids,
        (*a.pieces, keyframes, *(k + keyframes for k in b.pieces)),
        a.vetoed | {number + len(a.closures) for number in b.vetoed},
    )
    return optimise(joined, config)


def joined_receivers(a: Mapping[str, ReceiverOffset], b: Mapping[str, ReceiverOffset]) -> dict[str, ReceiverOffset]:
    """The offsets of the receivers of two maps, from the reference of `a`: that of `b` is found by what both know."""
    shared = [a[name].offset_db - b[name].offset_db for name in b if name in a]
    moved_db = float(np.median(shared)) if shared else 0.0
    return {name: replace(offset, offset_db=offset.offset_db + moved_db) for name, offset in b.items()} | dict(a)


def _wings(building: BuildingMap) -> int:
    return max((f.wing for f in building.factors.values() if isinstance(f, AxisFactor)), default=0)


def _moved(factor: Factor, keyframes: int, wings: int) -> Factor:
    if isinstance(factor, AxisFactor):
        return replace(factor, b=factor.b + keyframes, wing=factor.wing + wings)
    return replace(factor, a=factor.a + keyframes, b=factor.b + keyframes)


def _moved_closure(closure: MapClosure, keyframes: int, closures: int, factors: int) -> MapClosure:
    judged = closure.judged
    moved = replace(
        judged,
        closure=judged.closure + closures,
        keyframe_a=judged.keyframe_a + keyframes,
        keyframe_b=judged.keyframe_b + keyframes,
    )
    return MapClosure(moved, tuple(number + factors for number in closure.factors))


def _moved_fingerprint(fingerprint: MapFingerprint, keyframes: int) -> MapFingerprint:
    return replace(fingerprint, keyframe=fingerprint.keyframe + keyframes)


def _judged(number: int, tie: Tie, a: BuildingMap, b: BuildingMap) -> ClosureJudged:
    by_laser = isinstance(tie.factor, BetweenFactor)
    kf_a, kf_b = tie.factor.a, tie.factor.b
    return ClosureJudged(
        number, a.keyframes[kf_a].stamp_ns, b.keyframes[kf_b].stamp_ns, kf_a, kf_b + len(a.keyframes),
        ClosureKind.LIDAR if by_laser else ClosureKind.WIFI, "merge", tie.similarity, tie.residual_m, tie.inlier_ratio,
        tie.T_a_b, tie.covariance, by_laser, Verdict.ACCEPTED, tie.reason,
    )  # fmt: skip


def joined_weights(a: Mapping[str, float], b: Mapping[str, float]) -> dict[str, float]:
    """The mean of what two drives say of each access point, or what the one says that heard it."""
    return {name: (a.get(name, b.get(name, 0.0)) + b.get(name, a.get(name, 0.0))) / 2 for name in {**a, **b}}
