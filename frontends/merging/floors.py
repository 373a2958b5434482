"""Floors of two maps: which of one is which of the other, and how they are numbered in the joined map.

Each map numbers its floors by itself. An access point is heard a floor away as well, only less, so that a floor that
one map does not know sounds like the one below it: two floors are only taken for one where each sounds most like the
other.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.merging_config import MergingConfig
from wayfi.frontends.merging.wifi_overlap import like_places


def like_floors(a: BuildingMap, b: BuildingMap, sigma_db: float, config: MergingConfig) -> dict[int, int]:
    """The floors of `a` by those of `b`, where each of the two sounds most like the other of all."""
    if len(a.floors) == len(b.floors) == 1:
        return {b.floors[0]: a.floors[0]}
    of_b, of_a = _most_like(a, b, sigma_db, config), _most_like(b, a, sigma_db, config)
    return {floor: like for floor, like in sorted(of_b.items()) if of_a.get(like) == floor}


def on_floor(building: BuildingMap, floor: int) -> BuildingMap:
    """The map with the scans and fingerprints of one floor alone; its keyframes keep their numbers."""
    if building.floors == [floor]:
        return building
    return replace(
        building,
        keyframes=[k if k.floor == floor else replace(k, scan=None) for k in building.keyframes],
        fingerprints=[f for f in building.fingerprints if building.keyframes[f.keyframe].floor == floor],
    )


def numbered(a: BuildingMap, b: BuildingMap, joined: Mapping[int, int]) -> dict[int, int]:
    """The numbers of the floors of `b` in the joined map: those of `a` for the `joined`, then free ones in order."""
    free = 1 + max(a.floors)
    others = [floor for floor in b.floors if floor not in joined]
    return dict(joined) | {floor: free + n for n, floor in enumerate(others)}


def apart(one: Pose2, other: Pose2, b: BuildingMap) -> tuple[float, float]:
    """By how many m and rad two poses of the frame of `b` differ, where its drives go from a floor to another.

    A map knows its floors' headings from each other less well than those of a floor, which turns them about that place.
    """
    places = _passages(b)
    metres = np.hypot(*(one.transform(places) - other.transform(places)).T)
    return float(metres.min()), abs(one.between(other).theta)


def _most_like(a: BuildingMap, b: BuildingMap, sigma_db: float, config: MergingConfig) -> dict[int, int]:
    """The floor of `a` by that of `b`, on which most of the places are that sound like those of the latter."""
    pairs = like_places(a, b, sigma_db, config)
    votes: dict[int, Counter[int]] = {}
    for n_a, n_b in zip(pairs.a.tolist(), pairs.b.tolist(), strict=True):
        of_b = b.keyframes[b.fingerprints[n_b].keyframe].floor
        votes.setdefault(of_b, Counter())[a.keyframes[a.fingerprints[n_a].keyframe].floor] += 1
    return {floor: counts.most_common(1)[0][0] for floor, counts in votes.items()}


def _passages(building: BuildingMap) -> Floats:
    """(n, 2) m where the robot was first on another floor than before; the middle of the map where it never was."""
    keyframes = building.keyframes
    changed = [k for k in range(1, len(keyframes)) if keyframes[k].floor != keyframes[k - 1].floor]
    return building.poses[changed, :2] if changed else building.poses[:, :2].mean(axis=0, keepdims=True)
