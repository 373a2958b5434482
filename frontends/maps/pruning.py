"""A map that was driven again keeps its size: it grows with the area, not with the time.

A place that an earlier session covers needs no further keyframe, unless much of what is seen there is new: then the new
keyframe takes the place of the nearest earlier one. What the others measured stays in the graph (see marginalising).
Fingerprints of earlier sessions give way to new ones of the same place, so that access points that are gone age out.
"""

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.factors import Factor
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.options import option
from wayfi.frontends.lidar.visibility import VisibilityConfig
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.continuing import known_factors
from wayfi.frontends.maps.marginalising import Marginalisation
from wayfi.frontends.maps.seen_area import SeenArea
from wayfi.frontends.maps.selecting import selected
from wayfi.frontends.maps.staleness import StalenessConfig, without_stale_points


@dataclass(frozen=True)
class PruningConfig:
    """Which keyframes and fingerprints of a new session a map keeps."""

    near_m: float = option(
        1.0, "m", "from a kept keyframe the place is covered; nearer new fingerprints replace earlier ones"
    )
    far_m: float = option(40.0, "m", "beyond the keyframes: what is seen there is not looked at")
    novel_share: float = option(0.1, "", "of a scan's points where none was seen: a car or a shelf has come")
    staleness: StalenessConfig = field(default_factory=StalenessConfig)


def pruned(
    building: BuildingMap,
    config: PruningConfig,
    visibility: VisibilityConfig,
    grid: MapConfig,
    first: int | None = None,
) -> BuildingMap:
    """The map without what its keyframes from `first` on have repeated: those of its newest session, if not given.

    A map in which none is before them, or from them on, stays as it is.
    """
    newest = max((k.session for k in building.keyframes), default=0)
    first = sum(k.session < newest for k in building.keyframes) if first is None else first
    if not 0 < first < len(building.keyframes):
        return building
    keyframes = without_stale_points(building.keyframes, building.poses, first, config.staleness, visibility)
    cleaned = replace(building, keyframes=keyframes)
    kept = _kept_keyframes(cleaned, first, config)
    fingerprints = [building.fingerprints[n] for n in _kept_fingerprints(cleaned, config.near_m)]
    return selected(replace(cleaned, fingerprints=fingerprints), kept, _left_factors(cleaned, kept), grid)


def without_sessions(building: BuildingMap, left_out: Collection[int], grid: MapConfig) -> BuildingMap:
    """The map without the keyframes of some of its sessions; what they measured of the others stays in the graph."""
    kept = np.flatnonzero([keyframe.session not in left_out for keyframe in building.keyframes])
    fingerprints = [f for f in building.fingerprints if building.keyframes[f.keyframe].session not in left_out]
    return selected(replace(building, fingerprints=fingerprints), kept, _left_factors(building, kept), grid)


def _kept_keyframes(building: BuildingMap, first: int, config: PruningConfig) -> NDArray[np.int64]:
    """The keyframes that stay, in their order; from `first` on they are of the new session."""
    positions = building.poses[:, :2]
    low, high = positions.min(axis=0) - config.far_m, positions.max(axis=0) + config.far_m
    floors = np.array([keyframe.floor for keyframe in building.keyframes])
    areas = {floor: SeenArea(low, high) for floor in building.floors}
    kept = np.zeros(len(positions), np.bool_)
    kept[:first] = True
    for number, (keyframe, pose) in enumerate(zip(building.keyframes, building.poses, strict=True)):
        apart_m = np.hypot(*(positions - pose[:2]).T)
        near = np.flatnonzero(kept & (apart_m < config.near_m) & (floors == keyframe.floor))
        area = areas[keyframe.floor]
        if number >= first:
            if len(near) and area.novel_share(keyframe.scan, pose) <= config.novel_share:
                continue
            earlier = near[near < first]
            if len(earlier):
                kept[earlier[np.argmin(apart_m[earlier])]] = False
            kept[number] = True
        area.add(keyframe.scan, pose)
    return np.flatnonzero(kept)


def _kept_fingerprints(building: BuildingMap, near_m: float) -> list[int]:
    """The fingerprints that stay: those with none of a later session near them."""
    places = building.fingerprint_poses()[:, :2]
    keyframes = [building.keyframes[f.keyframe] for f in building.fingerprints]
    sessions = np.array([keyframe.session for keyframe in keyframes], np.int64)
    floors = np.array([keyframe.floor for keyframe in keyframes], np.int64)
    return [
        number
        for number, (place, session, floor) in enumerate(zip(places, sessions, floors, strict=True))
        if not (np.hypot(*(places[(sessions > session) & (floors == floor)] - place).T) < near_m).any()
    ]


def _left_factors(building: BuildingMap, kept: NDArray[np.int64]) -> dict[int, Factor]:
    """The factors between the keyframes that are kept; those of vetoed closures as they are."""
    numbers = set(kept.tolist())
    of_closures = {n for closure in building.closures for n in closure.factors}
    known = known_factors(building)
    graph = Marginalisation(known, building.poses, of_closures)
    graph.remove_all(k for k in range(len(building.keyframes)) if k not in numbers)
    vetoed = {number: factor for number, factor in building.factors.items() if number not in known}
    return graph.factors | {n: f for n, f in vetoed.items() if f.a in numbers and f.b in numbers}
