"""Maps to save: made up, with every kind of factor, and what no drive of the tests has."""

from dataclasses import replace

import numpy as np

from wayfi.backend.graph.factors import AxisFactor, BetweenFactor, Factor, NearFactor, WheelFactor
from wayfi.backend.graph.wheel_calibration import WheelCalibration, WheelMotion
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import ClosureJudged, ClosureKind, Verdict
from wayfi.frontends.maps.building_map import BuildingMap, MapClosure, MapFingerprint, MapKeyframe
from wayfi.frontends.maps.optimising import drawn
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.wifi.readings import Readings
from wayfi.frontends.wifi.receivers import ReceiverOffset

FIRST_NS = 1_700_000_000_123_456_789


def made_up_map(keyframes: int, seed: int = 0, beams: int = 40) -> BuildingMap:
    """A map of so many keyframes, of two sessions on two floors; every seventh keyframe has no scan."""
    chance = np.random.default_rng(seed)
    kept = [_keyframe(k, keyframes, beams, chance) for k in range(keyframes)]
    poses = np.column_stack(
        [np.arange(keyframes) * 0.5, chance.normal(0, 1, keyframes), chance.uniform(-3, 3, keyframes)]
    )
    fingerprints = [_fingerprint(k, chance) for k in range(0, keyframes, 3)]
    bssids = dict.fromkeys(bssid for f in fingerprints for bssid in f.readings.bssids)
    return BuildingMap(
        kept, poses, chance.normal(0, 0.01, (keyframes, 4)), _factors(keyframes, chance),
        [_closure(k, chance) for k in range(keyframes // 10)], fingerprints,
        {bssid: float(chance.uniform()) for bssid in bssids},
        Calibration(WheelCalibration(chance.normal(0, 0.01, 4), np.full(4, 0.1)), {"wlan0": ReceiverOffset(0.0, 0.0)}),
        drawn(kept, poses, MapConfig()), (5,) if keyframes > 5 else (), frozenset({1} if keyframes >= 20 else ()),
    )  # fmt: skip


def grown(building: BuildingMap, keyframes: int) -> BuildingMap:
    """The first keyframes of a map, with what is of them."""
    closures = [c for c in building.closures if c.judged.keyframe_b < keyframes]
    return replace(
        building,
        keyframes=building.keyframes[:keyframes],
        poses=building.poses[:keyframes],
        calibrations=building.calibrations[:keyframes],
        factors={n: f for n, f in building.factors.items() if max(f.a, f.b) < keyframes},
        closures=closures,
        fingerprints=[f for f in building.fingerprints if f.keyframe < keyframes],
        pieces=tuple(k for k in building.pieces if k < keyframes),
        vetoed=frozenset(k for k in building.vetoed if k < len(closures)),
    )


def _keyframe(k: int, keyframes: int, beams: int, chance: np.random.Generator) -> MapKeyframe:
    angles = np.sort(chance.uniform(-np.pi, np.pi, beams))
    hits = np.column_stack([np.cos(angles), np.sin(angles)]) * chance.uniform(1, 9, (beams, 1))
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    normals[::5] = np.nan
    scan = ScanPoints(hits + 0.0004, normals, Pose2(*chance.normal(0, 0.3, 3).tolist()))
    seen = k % 7 != 3
    later = k >= keyframes * 2 // 3
    stamp_ns, none = FIRST_NS + k * 500_000_000, np.empty((0, 2), np.float32)
    return MapKeyframe(
        stamp_ns,
        k * 0.5 + 1 / 3,
        scan if seen else None,
        hits.astype(np.float32) if seen else none,
        int(later),
        int(later),
    )


def _factors(keyframes: int, chance: np.random.Generator) -> dict[int, Factor]:
    factors: list[Factor] = []
    for b in range(1, keyframes):
        motion = WheelMotion(_pose(chance), float(chance.uniform()), float(chance.uniform()), b % 2)
        factors += [WheelFactor(b - 1, b, motion, _covariance(chance), b == 1)]
        factors += [BetweenFactor(b - 1, b, _pose(chance), _covariance(chance))]
        if b % 8 == 0:
            factors += [NearFactor(b - 8, b, chance.normal(0, 1, 2), chance.normal(0, 1, 2), 0.75)]
            factors += [AxisFactor(b, 1 + b % 3, float(chance.normal()), 0.01)]
    return {2 * number + (number > 3): factor for number, factor in enumerate(factors)}


def _closure(k: int, chance: np.random.Generator) -> MapClosure:
    covariance = _covariance(chance)
    judged = ClosureJudged(
        k, FIRST_NS, FIRST_NS + k, k, 10 * k + 9, ClosureKind.WIFI, "wifi", float("nan"), 0.1, 0.9, _pose(chance),
        covariance, k % 2 == 0, list(Verdict)[k % 3], "agrees, so it is said",
    )  # fmt: skip
    return MapClosure(judged, (k, k + 1) if k % 3 == 0 else ())


def _fingerprint(k: int, chance: np.random.Generator) -> MapFingerprint:
    heard = chance.choice(40, chance.integers(0, 12), replace=False)
    readings = Readings(
        tuple(f"02:00:00:00:00:{n:02x}" for n in heard),
        chance.uniform(-90, -30, len(heard)).astype(np.float32),
        chance.uniform(0, 1, len(heard)).astype(np.float32),
    )
    return MapFingerprint(FIRST_NS + k, f"wlan{k % 2}", k, _pose(chance), k * 0.5, readings)


def _pose(chance: np.random.Generator) -> Pose2:
    return Pose2(*chance.normal(0, 1, 3).tolist())


def _covariance(chance: np.random.Generator) -> Floats:
    root = chance.normal(0, 0.1, (3, 3))
    return np.asarray(root @ root.T + np.eye(3) * 1e-4)
