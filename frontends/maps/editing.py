"""Edits of a map by hand: closures that are vetoed or restored, and the list of them to choose from."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from wayfi.backend.errors import WayfiError
from wayfi.backend.graph.factors import AxisFactor, distance_m
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.building_map import BuildingMap, MapClosure
from wayfi.frontends.maps.optimising import OptimisingConfig, optimise

VETOED = "vetoed"  # in place of a verdict


class EditError(WayfiError):
    """An edit that the map does not allow."""


@dataclass(frozen=True, slots=True)
class ListedClosure:
    """A closure as a person judges it: `place` is where its later keyframe stands (m in `map`).

    `residual_m` is how far the map leaves the two keyframes from what the closure claims, NaN where one is gone.
    """

    number: int
    stamp_ns: int
    place: tuple[float, float]
    kind: str
    verdict: str
    residual_m: float
    reason: str


def edit(
    building: BuildingMap, config: OptimisingConfig, veto: Iterable[int] = (), restore: Iterable[int] = ()
) -> BuildingMap:
    """The map without the closures to `veto` and with those to `restore`, optimised anew.

    A closure stays vetoed until it is restored, which undoes the veto. Raises EditError, or OptimisingError, where that
    is impossible.
    """
    vetoed = set(building.vetoed)
    for number in dict.fromkeys(veto):
        _check_vetoed(building, number)
        vetoed.add(number)
    for number in dict.fromkeys(restore):
        if number not in vetoed:
            raise EditError(f"closure {number} is not vetoed: there is nothing to restore")
        vetoed.remove(number)
    return optimise(replace(building, vetoed=frozenset(vetoed)), config)


def listed_closures(building: BuildingMap) -> list[ListedClosure]:
    """Every closure, in the order of their numbers."""
    return [_listed(building, number, closure) for number, closure in enumerate(building.closures)]


def _check_vetoed(building: BuildingMap, number: int) -> None:
    if not 0 <= number < len(building.closures):
        has = f"they are 0 to {len(building.closures) - 1}" if building.closures else "it has none"
        raise EditError(f"there is no closure {number} in this map: {has}")
    if number in building.vetoed:
        raise EditError(f"closure {number} is vetoed already")
    judged = building.closures[number].judged
    if not building.closures[number].factors:
        raise EditError(f"closure {number} is not part of the map ({judged.verdict}: {judged.reason}): nothing to veto")


def _listed(building: BuildingMap, number: int, closure: MapClosure) -> ListedClosure:
    judged = closure.judged
    known = max(judged.keyframe_a, judged.keyframe_b) < len(building.poses)
    x, y, _ = building.poses[judged.keyframe_b] if known else (math.nan,) * 3
    verdict = VETOED if number in building.vetoed else judged.verdict.value
    residual_m = _residual_m(building, closure) if known else math.nan
    return ListedClosure(
        number, judged.stamp_b_ns, (float(x), float(y)), judged.kind.value, verdict, residual_m, judged.reason
    )


def _residual_m(building: BuildingMap, closure: MapClosure) -> float:
    for number in closure.factors:
        factor = building.factors[number]
        if not isinstance(factor, AxisFactor):
            return distance_m(factor, Pose2.of(building.poses[factor.a]), Pose2.of(building.poses[factor.b]))
    judged = closure.judged
    T_a_b = Pose2.of(building.poses[judged.keyframe_a]).between(Pose2.of(building.poses[judged.keyframe_b]))
    return T_a_b.distance(judged.T_a_b)
