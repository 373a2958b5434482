"""Two maps of one building, made at different times or by different robots, made one, floor by floor.

WiFi says roughly where one lies in the other, and whether at all; the laser looks there, at many places. They are only
joined where both agree at several places that lie some metres apart, nothing else fits about as well, and the scans of
one do not look through the walls of the other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from wayfi.backend.errors import WayfiError
from wayfi.backend.graph.factors import BetweenFactor, NearFactor
from wayfi.backend.pose2 import Floats, Pose2, rigid_fit
from wayfi.frontends.closures.lidar_check import Expected, innovation_chi2
from wayfi.frontends.maps.aligning import moved
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.joining import Tie, join
from wayfi.frontends.maps.merging_config import MergingConfig
from wayfi.frontends.maps.optimising import OptimisingConfig
from wayfi.frontends.merging.floors import apart, like_floors, numbered, on_floor
from wayfi.frontends.merging.laser_overlap import Spot, agreeing, check_along
from wayfi.frontends.merging.laser_search import search_overlap
from wayfi.frontends.merging.wifi_overlap import LikePlaces, Overlap, find_overlap, independent_places, like_places
from wayfi.frontends.odometry.odometry_config import calibration_prior
from wayfi.frontends.slam_config import SlamConfig

UNCLAIMED_RAD = 30.0  # the sigma of a heading that is not claimed: five turns
TIE_SIGMAS = (0.2, 0.02)  # m and rad: of what the laser has found at many places, from which it looks once more
SEARCHED_SIGMAS = (0.4, 0.05)  # m and rad: of a search in cells of 0.2 m
ROUNDS = 3  # of leaving out ties that the joined map contradicts
ARM_M = 1.0  # of keyframes that tell a heading by their positions
MOST_LEFT_OUT = 0.2  # of the ties: more say that the maps do not belong together
NOTHING_ALIKE = (
    "no place of one map sounds like one of the other: they are of different buildings or do not overlap (if all "
    "access points were replaced, wifi.enabled=false merges by the laser alone)"
)


class MergeError(WayfiError):
    """Two maps that are not joined, for the reason that it tells."""


@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """The joined map, and what it rests on: WiFi's places, checks of the laser that agree, and how far both reach (m).

    `T_a_b` is where the frame of the second map lies in the first one's, which is that of the joined one. `floors` are
    the numbers of the floors of the second map in the joined one.
    """

    building: BuildingMap
    T_a_b: Pose2
    places: int
    checks: int
    spread_m: float
    floors: Mapping[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """What two maps rest on, on a floor of each: the pose of the second one's frame, and what relates them."""

    T_a_b: Pose2
    ties: Sequence[Tie]
    places: int
    checks: int
    spread_m: float


def merge(a: BuildingMap, b: BuildingMap, config: SlamConfig) -> Merged:
    """The one map of two, floor by floor: the floors of `b` that are none of `a` come along with those that are.

    Raises MergeError where it is not certain that, and how, they overlap, or where floors contradict each other.
    """
    if not a.keyframes or not b.keyframes:
        raise MergeError("a map without keyframes cannot be merged")
    found = _found_by_floor(a, b, config)
    best = max(found.values(), key=lambda one: (one.checks, one.places))
    _refuse_contradiction(found, b, config.merging)
    floors = numbered(a, b, dict(found.keys()))
    ties = [tie for one in found.values() for tie in one.ties]
    building = _in_frame_of(a, _joined(a, b, best.T_a_b, ties, floors, config), config)
    places, checks = sum(one.places for one in found.values()), sum(one.checks for one in found.values())
    return Merged(building, best.T_a_b, places, checks, max(one.spread_m for one in found.values()), floors)


def place_of(own: Floats, joined: Floats) -> Pose2:
    """Where the frame of a map lies in a joined one, by the poses (n, 3) of its keyframes in both, as they fit best."""
    source, target = own[:, :2], joined[:, :2]
    if np.hypot(*(source - source.mean(axis=0)).T).mean() < ARM_M:
        return Pose2.of(joined[-1]) @ Pose2.of(own[-1]).inverse()
    return rigid_fit(source, target)


def _in_frame_of(a: BuildingMap, joined: BuildingMap, config: SlamConfig) -> BuildingMap:
    """The joined map with the keyframes of `a` where they were: the graph holds the first, around which others turn."""
    T_joined_a = place_of(a.poses, joined.poses[: len(a.keyframes)])
    return moved(joined, T_joined_a.inverse(), config.map)


def _found_by_floor(a: BuildingMap, b: BuildingMap, config: SlamConfig) -> dict[tuple[int, int], _Found]:
    """What joins the maps, by the floor of `b` and that of `a`. Raises MergeError where nothing does on any floor."""
    by_wifi = config.wifi.enabled and len(a.fingerprints) > 0 and len(b.fingerprints) > 0
    if not by_wifi and len(a.floors) + len(b.floors) > 2:
        raise MergeError("the maps have several floors and no WiFi in common: nothing tells which floor is which")
    like = like_floors(a, b, config.wifi.similarity_sigma_db, config.merging) if by_wifi else {b.floors[0]: a.floors[0]}
    found, refused = {}, [] if like else [MergeError(NOTHING_ALIKE)]
    for floor_b, floor_a in like.items():
        try:
            found[floor_b, floor_a] = _found(on_floor(a, floor_a), on_floor(b, floor_b), by_wifi, config)
        except MergeError as error:
            refused.append(error)
    if not found:
        raise refused[0]
    return found


def _refuse_contradiction(found: Mapping[tuple[int, int], _Found], b: BuildingMap, bounds: MergingConfig) -> None:
    """Raise MergeError where two floors say that the maps lie otherwise."""
    for (one, first), (other, second) in combinations(found.items(), 2):
        metres, radians = apart(first.T_a_b, second.T_a_b, b)
        if metres > bounds.floors_agree_m or radians > bounds.floors_agree_rad:
            raise MergeError(
                f"the floors contradict each other: by floor {one[0]} of the second map it lies {metres:.1f} m and "
                f"{radians:.2f} rad from where floor {other[0]} puts it; {bounds.floors_agree_m:g} m and "
                f"{bounds.floors_agree_rad:g} rad are allowed"
            )


def _found(a: BuildingMap, b: BuildingMap, by_wifi: bool, config: SlamConfig) -> _Found:
    """What joins two maps of one floor. Raises MergeError where nothing does for certain."""
    by_laser = config.lidar.enabled and _has_scans(a) and _has_scans(b)
    if not by_wifi and not by_laser:
        raise MergeError("the maps have neither WiFi nor scans in common: nothing tells whether they overlap")
    if not by_wifi:
        return _found_by_laser(a, b, config)
    pairs = like_places(a, b, config.wifi.similarity_sigma_db, config.merging)
    overlap = _overlap(pairs, by_laser, config.merging)
    if not by_laser:
        ties = _wifi_ties(pairs, overlap, a, b)
        return _Found(overlap.T_a_b, ties, overlap.places, 0, overlap.spread_m)
    sigmas = config.merging.wifi_sigma_m, config.merging.wifi_sigma_rad
    T, spots = _confirmed(a, b, overlap.T_a_b, sigmas, config.merging.min_checks, config)
    return _Found(
        T, [_laser_tie(spot) for spot in spots], overlap.places, len(spots), _spread_m(b, spots, config.merging)
    )


def _found_by_laser(a: BuildingMap, b: BuildingMap, config: SlamConfig) -> _Found:
    """Maps of which one has no WiFi: more is asked of the laser, since buildings repeat."""
    found, bounds = search_overlap(a, b, config), config.merging
    if found is None or found.agreeing < bounds.min_searched or found.agreeing < bounds.min_found * found.searched:
        agreeing, searched = (found.agreeing, found.searched) if found else (0, 0)
        raise MergeError(
            f"the laser does not find one map in the other: {agreeing} of {searched} parts agree on where it lies; "
            f"{bounds.min_searched}, and {bounds.min_found:.0%}, are needed where there is no WiFi"
        )
    if found.rival > bounds.max_rival * found.agreeing:
        raise MergeError(
            f"the maps fit in more than one way: {found.agreeing} parts of one agree on where it lies, {found.rival} "
            "on another place; the building repeats, and WiFi could tell"
        )
    T, spots = _confirmed(a, b, found.T_a_b, SEARCHED_SIGMAS, bounds.min_checks_alone, config)
    return _Found(T, [_laser_tie(spot) for spot in spots], 0, len(spots), _spread_m(b, spots, bounds))


def _has_scans(building: BuildingMap) -> bool:
    return any(k.scan is not None for k in building.keyframes)


def _overlap(pairs: LikePlaces, by_laser: bool, config: MergingConfig) -> Overlap:
    """Where WiFi puts the one map in the other. Raises MergeError where it does not say so."""
    found = find_overlap(pairs, config)
    if found is None:
        raise MergeError(NOTHING_ALIKE)
    least = config.min_places if by_laser else config.wifi_alone_places
    share = float(found.explained.mean())
    if share < config.min_explained:
        raise MergeError(
            f"WiFi contradicts itself: of {len(pairs.a)} places that sound alike only {share:.0%} fit one position of "
            f"the maps, under {config.min_explained:.0%}"
        )
    if found.places < least or found.spread_m < config.min_spread_m:
        raise MergeError(
            f"the maps overlap too little: WiFi finds {found.places} places in both, over {found.spread_m:.0f} m; "
            f"{least} over {config.min_spread_m:g} m are needed"
        )
    if found.rival > config.max_rival:
        raise MergeError(f"the maps fit in more than one way by WiFi: the second explains {found.rival:.0%} as much")
    return found


def _confirmed(
    a: BuildingMap,
    b: BuildingMap,
    T_a_b: Pose2,
    sigmas: tuple[float, float],
    least: int,
    config: SlamConfig,
) -> tuple[Pose2, list[Spot]]:
    """The pose of the maps by the laser near `T_a_b`, and the checks that agree. Raises MergeError without them."""
    bounds = config.merging
    T, agreed = agreeing(check_along(a, b, T_a_b, sigmas, bounds.check_every_m, config), b, bounds)
    _judge(agreed, b, least, bounds)
    spots = check_along(a, b, T, TIE_SIGMAS, bounds.tie_every_m, config)
    T, agreed = agreeing(spots, b, bounds)
    _judge(agreed, b, least, bounds)
    contradicting = [s for s in spots if s not in agreed and s.found.inlier_ratio < config.closure.min_inlier_ratio]
    share = len(agreed) / (len(agreed) + len(contradicting))
    if share < bounds.min_agreeing:
        raise MergeError(
            f"the laser contradicts WiFi: of the scans that should fit the other map {share:.0%} do, under "
            f"{bounds.min_agreeing:.0%}"
        )
    through = float(np.median([spot.through for spot in spots]))
    if through > bounds.max_seen_through:
        raise MergeError(f"the scans of one map look through {through:.0%} of the walls of the other")
    return T, agreed


def _judge(agreed: Sequence[Spot], b: BuildingMap, least: int, bounds: MergingConfig) -> None:
    spread_m = _spread_m(b, agreed, bounds)
    if len(agreed) < least or spread_m < bounds.min_spread_m:
        raise MergeError(
            f"the laser does not confirm it: {len(agreed)} scans agree on where the maps lie, over {spread_m:.0f} m; "
            f"{least} over {bounds.min_spread_m:g} m are needed"
        )


def _spread_m(b: BuildingMap, spots: Sequence[Spot], config: MergingConfig) -> float:
    return independent_places(b.poses[[spot.b for spot in spots], :2], config.independent_m)[1]


def _laser_tie(spot: Spot) -> Tie:
    found = spot.found
    factor = BetweenFactor(spot.a, spot.b, found.T_a_b, found.covariance)
    return Tie(
        factor, found.T_a_b, found.covariance, "agrees with the others between the two maps", np.nan,
        found.inlier_ratio, found.residual_m,
    )  # fmt: skip


def _wifi_ties(pairs: LikePlaces, overlap: Overlap, a: BuildingMap, b: BuildingMap) -> list[Tie]:
    """The pairs that the motion explains; those within `independent_m` of each other count as one together."""
    apart = overlap.T_a_b.transform(pairs.place_b) - pairs.place_a
    explained = np.flatnonzero(overlap.explained)
    rms_m = float(np.sqrt((apart[explained] ** 2).mean()))
    sigma_m = rms_m * np.sqrt(max(len(explained) / overlap.places, 1.0))
    return [_wifi_tie(int(pairs.a[n]), int(pairs.b[n]), pairs.similarity[n], sigma_m, a, b) for n in explained]


def _wifi_tie(n_a: int, n_b: int, similarity: float, sigma_m: float, a: BuildingMap, b: BuildingMap) -> Tie:
    f_a, f_b = a.fingerprints[n_a], b.fingerprints[n_b]
    place_a, place_b = (np.array([f.T_keyframe_base.x, f.T_keyframe_base.y]) for f in (f_a, f_b))
    factor = NearFactor(f_a.keyframe, f_b.keyframe, place_a, place_b, sigma_m)
    covariance = np.diag([sigma_m**2, sigma_m**2, UNCLAIMED_RAD**2])
    return Tie(factor, f_a.T_keyframe_base @ f_b.T_keyframe_base.inverse(), covariance, "sounds alike", similarity)


def _joined(
    a: BuildingMap, b: BuildingMap, T_a_b: Pose2, ties: list[Tie], floors: Mapping[int, int], config: SlamConfig
) -> BuildingMap:
    """The maps joined by those of the ties that the joined map does not contradict. Raises MergeError without them."""
    optimising = OptimisingConfig(config.backend, config.map, calibration_prior(config.odometry))
    found = len(ties)
    for _ in range(ROUNDS):
        building = join(a, b, T_a_b, ties, optimising, floors)
        kept = [tie for tie in ties if _chi2(tie, building.poses, len(a.keyframes)) <= config.merging.remove_chi2]
        if len(kept) == len(ties):
            return building
        ties = kept
        if len(ties) < (1 - MOST_LEFT_OUT) * found:
            break
    raise MergeError(f"the joined map contradicts {found - len(ties)} of {found} of what relates the two")


def _chi2(tie: Tie, poses: Floats, first: int) -> float:
    factor = tie.factor
    T_map_a, T_map_b = Pose2.of(poses[factor.a]), Pose2.of(poses[factor.b + first])
    if isinstance(factor, NearFactor):
        at_a, at_b = T_map_a.transform(factor.place_a[None]), T_map_b.transform(factor.place_b[None])
        return float(((at_b - at_a) ** 2).sum()) / factor.sigma_m**2
    return innovation_chi2(Expected(T_map_a.between(T_map_b), np.zeros((3, 3))), factor.T_a_b, factor.covariance)
