"""Where one map lies in another, by the laser: scans of one checked against the walls of the other."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, between_all, rigid_fit, wrap
from wayfi.frontends.closures.lidar_check import CheckResult, Expected, check
from wayfi.frontends.lidar.visibility import seen_through_share
from wayfi.frontends.maps.building_map import BuildingMap, MapKeyframe
from wayfi.frontends.maps.merging_config import MergingConfig
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.slam_config import SlamConfig

BEND = 0.005  # of the distance from where two maps agree, by which they may part: good maps bend by less


@dataclass(frozen=True, slots=True, eq=False)
class Spot:
    """Keyframe b of one map, expected near keyframe a of the other, and what the check of its scan there found.

    `T_map` is the pose of b in the other map by that check; `through` is the share of the walls in view that the scan
    looks through at the pose that was expected.
    """

    a: int
    b: int
    found: CheckResult
    T_map: Pose2
    through: float


def check_along(
    a: BuildingMap, b: BuildingMap, T_a_b: Pose2, sigmas: tuple[float, float], every_m: float, config: SlamConfig
) -> list[Spot]:
    """Checks of scans of `b`, one each `every_m` of its path, where `T_a_b` puts them among the scans of `a`.

    `sigmas` (m, rad) say how well the pose is known.
    """
    spots, last_m, session = [], -math.inf, -1
    scans_a = np.flatnonzero([k.scan is not None for k in a.keyframes])
    for number, keyframe in enumerate(b.keyframes):
        if keyframe.session == session and keyframe.path_m - last_m < every_m:
            continue
        spot = _check(a, scans_a, b, number, T_a_b, sigmas, config) if keyframe.scan else None
        if spot is not None:
            spots.append(spot)
            last_m, session = keyframe.path_m, keyframe.session
    return spots


def agreeing(spots: Sequence[Spot], b: BuildingMap, config: MergingConfig) -> tuple[Pose2, list[Spot]]:
    """The pose of the frame of `b` with which most of the checks that passed agree, and these."""
    passed = [spot for spot in spots if not spot.found.refused]
    best: list[Spot] = []
    T = Pose2()
    for seed in passed:
        guess = seed.T_map @ Pose2.of(b.poses[seed.b]).inverse()
        near = _agree(guess, seed, passed, b, config)
        if len(near) > len(best):
            best, T = near, guess
    if len(best) > 1:
        T = _common(best, b)
    return T, best


def _agree(T: Pose2, seed: Spot, spots: Sequence[Spot], b: BuildingMap, config: MergingConfig) -> list[Spot]:
    near = []
    for spot in spots:
        off = (T @ Pose2.of(b.poses[spot.b])).between(spot.T_map)
        away_m = seed.T_map.distance(spot.T_map)
        if math.hypot(off.x, off.y) <= config.agree_m + BEND * away_m and abs(off.theta) <= config.agree_rad:
            near.append(spot)
    return near


def _common(spots: Sequence[Spot], b: BuildingMap) -> Pose2:
    """The one pose of the frame of `b` that fits the places of several spots; their headings where these are one."""
    own = b.poses[[spot.b for spot in spots]]
    found = np.array([spot.T_map.array() for spot in spots])
    arm_m = float(np.hypot(*(own[:, :2] - own[:, :2].mean(axis=0)).T).mean())
    fitted = rigid_fit(own[:, :2], found[:, :2])
    turns = found[:, 2] - own[:, 2]
    turn = math.atan2(float(np.sin(turns).mean()), float(np.cos(turns).mean()))
    if arm_m > 1.0 and abs(wrap(fitted.theta - turn)) < math.pi / 2:
        return fitted
    x, y = found[:, :2].mean(axis=0) - Pose2(0.0, 0.0, turn).transform(own[:, :2].mean(axis=0)[None])[0]
    return Pose2(float(x), float(y), turn)


def _check(
    a: BuildingMap,
    scans_a: np.ndarray[tuple[int], np.dtype[np.int64]],
    b: BuildingMap,
    number: int,
    T_a_b: Pose2,
    sigmas: tuple[float, float],
    config: SlamConfig,
) -> Spot | None:
    """The check of one scan; None where the other map has none near."""
    here, scan = T_a_b @ Pose2.of(b.poses[number]), b.keyframes[number].scan
    near = _nearest(here, a, scans_a, config)
    if near is None or scan is None:
        return None
    scans, placed = submap_around(a, near, config.closure.submap_reach)
    expected = Expected(
        Pose2.of(a.poses[near]).between(here), np.diag([sigmas[0] ** 2, sigmas[0] ** 2, sigmas[1] ** 2])
    )
    found = check(scan, scans, placed, expected, config.closure, config.lidar)
    if found is None:
        return None
    through = seen_through_share(scan, found.submap, found.T_a_b, config.lidar.visibility)
    return Spot(near, number, found, Pose2.of(a.poses[near]) @ found.T_a_b, through)


def _nearest(
    here: Pose2, a: BuildingMap, scans_a: np.ndarray[tuple[int], np.dtype[np.int64]], config: SlamConfig
) -> int | None:
    if len(scans_a) == 0:
        return None
    T = between_all(here.array(), a.poses[scans_a])
    distance = np.hypot(T[:, 0], T[:, 1])
    best = int(np.argmin(distance + config.closure.turn_cost_m_per_rad * np.abs(T[:, 2])))
    return int(scans_a[best]) if distance[best] <= config.closure.radius_m else None


def submap_around(building: BuildingMap, keyframe: int, reach: int) -> tuple[list[ScanPoints], Floats]:
    """The scans of up to `reach` keyframes to each side in the same piece, and their (n, 3) poses in the keyframe's."""
    first, last = piece_of(building, keyframe)
    numbers = [k for k in range(max(keyframe - reach, first), min(keyframe + reach + 1, last)) if _scan(building, k)]
    scans = [scan for k in numbers if (scan := _scan(building, k)) is not None]
    return scans, between_all(building.poses[keyframe], building.poses[numbers])


def piece_of(building: BuildingMap, keyframe: int) -> tuple[int, int]:
    """First and last (excluded) of the keyframes around one whose relative poses are known without closures."""
    begins = sorted({0, *building.pieces})
    after = bisect_right(begins, keyframe)
    return begins[after - 1], begins[after] if after < len(begins) else len(building.keyframes)


def _scan(building: BuildingMap, keyframe: int) -> ScanPoints | None:
    found: MapKeyframe = building.keyframes[keyframe]
    return found.scan
