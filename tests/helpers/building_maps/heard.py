"""Maps of buildings of which only the radio matters: what a robot heard at given places of known access points."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.maps.building_map import BuildingMap, MapFingerprint, MapKeyframe
from wayfi.frontends.maps.optimising import drawn
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior
from wayfi.frontends.wifi.readings import Readings
from wayfi.frontends.wifi.receivers import ReceiverOffset

LIMIT_DBM = -90.0
SHADOW_DB, SHADOW_M, FADING_DB = 4.0, 5.0, 2.0
WAVES = 64
NO_HITS = np.zeros((0, 2))

Levels = Mapping[str, Floats]


def rounds(count: int = 2, width_m: float = 40.0, height_m: float = 20.0, step_m: float = 1.0) -> Floats:
    """(n, 2) m places on that many rounds along the walls and through the middle of a hall."""
    x, y, middle = width_m, height_m, width_m / 2
    corners = [(0, 0), (x, 0), (x, y), (middle, y), (middle, 0), (0, 0), (0, y), (x, y), (x, 0), (0, 0)]
    round_ = np.concatenate(
        [
            np.linspace(a, b, max(2, int(np.hypot(*np.subtract(b, a)) / step_m)), endpoint=False)
            for a, b in pairwise(corners)
        ]
    )
    return np.tile(round_, (count, 1)).astype(np.float64)


def level_of(place: Sequence[float], xy: Floats, chance: np.random.Generator, power_dbm: float = -35.0) -> Floats:
    """(n,) dBm at `xy` (n, 2) of an access point at `place`, 2.5 m up, with shadowing that is alike over metres."""
    distance = np.hypot(np.hypot(*(xy - np.asarray(place)).T), 2.5)
    waves, phases = chance.normal(0, 1 / SHADOW_M, (WAVES, 2)), chance.uniform(0, 2 * np.pi, WAVES)
    shadow = SHADOW_DB * np.sqrt(2 / WAVES) * np.cos(xy @ waves.T + phases).sum(axis=1)
    return np.asarray(power_dbm - 32.0 * np.log10(distance) + shadow)


def heard_map(
    xy: Floats, levels: Levels, chance: np.random.Generator, offsets: Mapping[str, float] | None = None
) -> BuildingMap:
    """A map of fingerprints at `xy` (n, 2), of receivers in turn: what is over the limit of `levels` (n,) dBm each."""
    offsets = offsets or {"wlan0": 0.0}
    receivers = list(offsets)
    fingerprints = []
    for k in range(len(xy)):
        receiver = receivers[k % len(receivers)]
        faded = {bssid: float(level[k] + chance.normal(0, FADING_DB)) for bssid, level in levels.items()}
        heard = {bssid: level + offsets[receiver] for bssid, level in faded.items() if level >= LIMIT_DBM}
        readings = Readings(tuple(heard), np.array(list(heard.values()), np.float32), np.zeros(len(heard), np.float32))
        fingerprints.append(MapFingerprint(k * SECOND_NS, receiver, k, Pose2(), float(k), readings))
    keyframes = [MapKeyframe(k * SECOND_NS, float(k), None, NO_HITS) for k in range(len(xy))]
    poses = np.column_stack([xy, np.zeros(len(xy))])
    known = {name: ReceiverOffset(offset, 0.1) for name, offset in offsets.items()}
    calibration = Calibration(calibration_prior(OdometryConfig()), known)
    grid = drawn(keyframes, poses, MapConfig())
    return BuildingMap(keyframes, poses, np.zeros((len(xy), 4)), {}, [], fingerprints, {}, calibration, grid)
