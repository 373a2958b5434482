"""A map moved onto a floor plan, by where the robot was in the plan at some moments."""

import math
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.errors import WayfiError
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.pose2 import Floats, Pose2, compose_all, rigid_fit
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.optimising import drawn
from wayfi.frontends.measurements import SECOND_NS

AGREE_M = 0.5  # between a fix and where it puts the map: a mark on a plan, and what a map bends by over a building
APART_M = 2.0  # between the two fixes that lie furthest apart: to half a metre they give the heading to 0.25 rad
LONGEST_S = 30.0  # between keyframes: over a longer gap the map does not know where the robot was
MOST_TRIED = 60  # fixes of which every pair is tried, spread over them all
SCALE_OFF = 0.01  # of the plan's metres: more is another unit, or a plan that was printed and scanned


class AlignError(WayfiError):
    """Fixes that do not tell where the map lies."""


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """Where a map lies in a plan.

    `residuals_m` (n,) is how far each fix is from where the map puts it then, NaN where the map knows nothing of its
    moment; `used` (n,) are those that agree.
    """

    T_plan_map: Pose2
    residuals_m: Floats
    used: NDArray[np.bool_]


def align(building: BuildingMap, stamps_ns: NDArray[np.int64], fixes: Floats) -> Alignment:
    """Where the map lies in the frame of `fixes` (n, 3), poses of base_link at `stamps_ns` (n,), by their positions.

    Their headings are not used: files that hold none say 0. Raises AlignError where they do not tell.
    """
    places, known = _places_at(building, stamps_ns)
    if known.sum() < 2:
        raise AlignError(
            f"{int(known.sum())} of {len(fixes)} fixes are of a moment that the map knows; two are needed, at places "
            f"{APART_M:g} m apart"
        )
    onto = fixes[:, :2]
    apart_m = float(np.hypot(*(places[known][:, None] - places[known][None]).transpose(2, 0, 1)).max())
    if apart_m < APART_M:
        raise AlignError(f"the fixes lie within {apart_m:.1f} m: the heading needs two that are {APART_M:g} m apart")
    T = _best(places[known], onto[known])
    residuals_m = np.where(known, np.hypot(*(T.transform(places) - onto).T), np.nan)
    used = residuals_m <= AGREE_M
    if used.sum() < 2 or used.sum() <= known.sum() / 2:
        raise AlignError(_contradiction(places[known], onto[known], int(used.sum())))
    return Alignment(T, residuals_m, used)


def moved(building: BuildingMap, T_new_map: Pose2, config: MapConfig) -> BuildingMap:
    """The same map in another frame; its grids are drawn again."""
    poses = compose_all(T_new_map.array(), building.poses)
    return replace(building, poses=poses, grids=drawn(building.keyframes, poses, config))


def _places_at(building: BuildingMap, stamps_ns: NDArray[np.int64]) -> tuple[Floats, NDArray[np.bool_]]:
    """(n, 2) where the robot was at each stamp, between the keyframes around it; and whether the map knows."""
    stamps = np.array([k.stamp_ns for k in building.keyframes], np.int64)
    sessions = np.array([k.session for k in building.keyframes])
    order = np.argsort(stamps, kind="stable")
    if len(order) == 0:
        return np.zeros((len(stamps_ns), 2)), np.zeros(len(stamps_ns), np.bool_)
    after = np.searchsorted(stamps[order], stamps_ns)
    a, b = order[np.clip(after - 1, 0, len(order) - 1)], order[np.clip(after, 0, len(order) - 1)]
    gap_ns = stamps[b] - stamps[a]
    share = np.clip((stamps_ns - stamps[a]) / np.maximum(gap_ns, 1), 0.0, 1.0)[:, None]
    exact = (stamps_ns == stamps[a]) | (stamps_ns == stamps[b])
    between = (stamps_ns > stamps[a]) & (stamps_ns < stamps[b]) & (gap_ns <= LONGEST_S * SECOND_NS)
    places: Floats = (1 - share) * building.poses[a, :2] + share * building.poses[b, :2]
    return places, exact | (between & (sessions[a] == sessions[b]))


def _best(places: Floats, onto: Floats) -> Pose2:
    """The motion with which most fixes agree: the best of every pair, then by least squares over those."""
    tried = np.unique(np.linspace(0, len(places) - 1, min(len(places), MOST_TRIED)).astype(int))
    best, most = Pose2(), (-1, 0.0)
    for i, j in combinations(tried, 2):
        if math.hypot(*(places[i] - places[j])) < APART_M:
            continue
        T = rigid_fit(places[[i, j]], onto[[i, j]])
        off = np.hypot(*(T.transform(places) - onto).T)
        near = off <= AGREE_M
        score = int(near.sum()), -float(off[near].sum())
        if score > most:
            best, most = T, score
    agreeing = np.hypot(*(best.transform(places) - onto).T) <= AGREE_M
    return rigid_fit(places[agreeing], onto[agreeing]) if agreeing.sum() >= 2 else best


def _contradiction(places: Floats, onto: Floats, agreeing: int) -> str:
    """That the fixes contradict each other, and perhaps why."""
    told = f"the fixes contradict each other: {agreeing} of {len(places)} agree to {AGREE_M:g} m on where the map lies"
    spread, on_plan = (np.sqrt(((p - p.mean(axis=0)) ** 2).sum()) for p in (places, onto))
    scale = float(on_plan / spread)
    if scale > 0.0:
        middle, to = places.mean(axis=0), onto.mean(axis=0)
        T = rigid_fit((places - middle) * scale, onto - to)
        off = np.hypot(*(T.transform((places - middle) * scale) - (onto - to)).T)
        if len(places) > 2 and off.max() <= AGREE_M * scale and abs(scale - 1.0) > SCALE_OFF:
            return f"{told}; they would if a metre of the plan were {scale:.4g}: give them in metres"
    return told
