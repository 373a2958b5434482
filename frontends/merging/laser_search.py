"""Where one map lies in another by the laser alone: submaps of one are searched for all over the other.

Buildings repeat, so that each submap may fit at several places. They all count: the motion of the map that most submaps
agree on is where it lies, if no other one has nearly as many.
"""

import math
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.localization.map_search import MapSearch
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.merging.laser_overlap import submap_around
from wayfi.frontends.slam_config import SlamConfig

MOST_SEARCHED = 24  # submaps, spread over the map: each takes a second in a large one
SUBMAP_REACH = 5  # keyframes to each side: 5 m of path, which repeat less than one scan
SLICE = 1_000_000_000  # poses at once: a merge need not give way to anything
NEAR_M, NEAR_RAD = 1.0, 0.1  # between motions that are one: cells of the search, and what maps bend by


@dataclass(frozen=True, slots=True, eq=False)
class Searched:
    """The pose of the frame of one map in that of another on which most submaps agree.

    `agreeing` of the `searched` do, and `rival` as many on the next best.
    """

    T_a_b: Pose2
    agreeing: int
    rival: int
    searched: int


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """A place at which the submap of keyframe `number` fits."""

    number: int
    at: Pose2
    T_a_b: Pose2


def search_overlap(a: BuildingMap, b: BuildingMap, config: SlamConfig) -> Searched | None:
    """The best motion by a search of submaps of `b` all over `a`; None where none is found anywhere."""
    search, places, searched = MapSearch(a, config.localization.search), [], 0
    for number in _spread(b):
        scans, poses = submap_around(b, number, SUBMAP_REACH)
        if not search.begin(scans, poses):
            continue
        while (found := search.go_on(SLICE)) is None:
            pass
        searched += 1
        own = Pose2.of(b.poses[number]).inverse()
        places += [_Place(number, place.T_map_base, place.T_map_base @ own) for place in found.places]
    if not places:
        return None
    best = max((_agreeing(place, places, b) for place in places), key=_count)
    others = [place for place in places if place not in best]
    rival = max((_count(_agreeing(place, others, b)) for place in others), default=0)
    return Searched(best[0].T_a_b, _count(best), rival, searched)


def _spread(b: BuildingMap) -> list[int]:
    """Keyframes with scans, spread over the map."""
    seen = np.flatnonzero([k.scan is not None for k in b.keyframes])
    chosen = np.unique(np.linspace(0, len(seen) - 1, min(len(seen), MOST_SEARCHED)).astype(int))
    return [int(number) for number in seen[chosen]] if len(seen) else []


def _agreeing(place: _Place, places: list[_Place], b: BuildingMap) -> list[_Place]:
    """The place, and those which the same motion of the map explains."""
    near = [place]
    for other in places:
        off = (place.T_a_b @ Pose2.of(b.poses[other.number])).between(other.at)
        if other is not place and math.hypot(off.x, off.y) <= NEAR_M and abs(off.theta) <= NEAR_RAD:
            near.append(other)
    return near


def _count(places: list[_Place]) -> int:
    return len({place.number for place in places})
