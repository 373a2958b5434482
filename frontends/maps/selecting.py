"""A map of some of a map's keyframes."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.factors import AxisFactor, Factor
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.pose2 import Pose2, compose_all
from wayfi.frontends.maps.building_map import BuildingMap, MapClosure, MapFingerprint
from wayfi.frontends.maps.optimising import drawn


def selected(
    building: BuildingMap, kept: NDArray[np.int64], factors: Mapping[int, Factor], grid: MapConfig
) -> BuildingMap:
    """The map of the keyframes `kept`, numbered anew, and of the `factors`, which relate none but these.

    Fingerprints of others hang on the nearest keyframe; closures between others go. The grid is drawn from the rest.
    """
    numbers = {int(old): new for new, old in enumerate(kept)}
    keyframes, poses = [building.keyframes[k] for k in kept], building.poses[kept]
    floors = np.array([keyframe.floor for keyframe in keyframes], np.int64)
    closures = [closure for closure in building.closures if _stays(closure, numbers)]
    return replace(
        building,
        keyframes=keyframes,
        poses=poses,
        calibrations=building.calibrations[kept],
        factors={number: _renumbered_factor(factor, numbers) for number, factor in factors.items()},
        closures=[_renumbered(closure, new, numbers, factors) for new, closure in enumerate(closures)],
        fingerprints=[_anchored(fingerprint, building, kept, floors) for fingerprint in building.fingerprints],
        grids=drawn(keyframes, poses, grid),
        pieces=tuple(sorted({int(np.searchsorted(kept, piece)) for piece in building.pieces} - {0, len(kept)})),
        vetoed=frozenset(new for new, closure in enumerate(closures) if closure.judged.closure in building.vetoed),
    )


def alone(building: BuildingMap, first: int, grid: MapConfig) -> BuildingMap:
    """The map of the keyframes from `first` on, related to none before; it begins at the origin of floor 0."""
    kept = np.arange(first, len(building.keyframes))
    T = Pose2.of(building.poses[first]).inverse()
    met = dict.fromkeys(keyframe.floor for keyframe in building.keyframes[first:])
    floors = {floor: number for number, floor in enumerate(met)}
    own = replace(
        building,
        poses=compose_all(T.array(), building.poses),
        keyframes=[
            replace(keyframe, session=0, floor=floors.get(keyframe.floor, 0)) for keyframe in building.keyframes
        ],
        fingerprints=[fingerprint for fingerprint in building.fingerprints if fingerprint.keyframe >= first],
    )
    factors = {number: f for number, f in building.factors.items() if min(f.a, f.b) >= first}
    return selected(own, kept, factors, grid)


def _renumbered_factor(factor: Factor, numbers: Mapping[int, int]) -> Factor:
    if isinstance(factor, AxisFactor):
        return replace(factor, b=numbers[factor.b])
    return replace(factor, a=numbers[factor.a], b=numbers[factor.b])


def _stays(closure: MapClosure, numbers: Mapping[int, int]) -> bool:
    return closure.judged.keyframe_a in numbers and closure.judged.keyframe_b in numbers


def _renumbered(
    closure: MapClosure, number: int, keyframes: Mapping[int, int], factors: Mapping[int, Factor]
) -> MapClosure:
    a, b = (keyframes[k] for k in (closure.judged.keyframe_a, closure.judged.keyframe_b))
    judged = replace(closure.judged, closure=number, keyframe_a=a, keyframe_b=b)
    return MapClosure(judged, tuple(n for n in closure.factors if n in factors))


def _anchored(
    fingerprint: MapFingerprint, building: BuildingMap, kept: NDArray[np.int64], floors: NDArray[np.int64]
) -> MapFingerprint:
    """A fingerprint in the nearest keyframe of its floor that is `kept`; `floors` (n,) are theirs."""
    poses, floor = building.poses, building.keyframes[fingerprint.keyframe].floor
    T = Pose2.of(poses[fingerprint.keyframe]) @ fingerprint.T_keyframe_base
    nearest = int(np.argmin(np.where(floors != floor, np.inf, np.hypot(*(poses[kept, :2] - (T.x, T.y)).T))))
    return replace(fingerprint, keyframe=nearest, T_keyframe_base=Pose2.of(poses[kept[nearest]]).between(T))
