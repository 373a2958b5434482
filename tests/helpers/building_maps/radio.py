"""Maps of radio alone, made of simulated access points whose RSSI is known everywhere."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.localization.wifi_belief import WifiBelief
from wayfi.frontends.maps.building_map import BuildingMap, MapFingerprint, MapKeyframe
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.wifi.readings import Readings
from wayfi.frontends.wifi.receivers import ReceiverOffset

STEP_M = 0.5  # between fingerprints, and between the scans of a drive
STEP_COVARIANCE = np.diag([0.02**2, 0.01**2, 0.01**2])
Change = Callable[[Readings], Readings]


@dataclass(frozen=True)
class Radio:
    """Access points at `places` (n, 2) m, with the wall loss and the shadowing that each has everywhere.

    A receiver reads `ahead_db` more of what is straight ahead of it, and as much less of what is behind.
    """

    bssids: tuple[str, ...]
    places: Floats
    loss_db: Floats
    waves: Floats
    phases: Floats
    ahead_db: float = 0.0

    def readings(
        self, xy: Floats, chance: np.random.Generator, fading_db: float = 2.5, heading: float = 0.0
    ) -> Readings:
        """What a receiver hears at `xy` (2,) m that faces `heading` (rad)."""
        away = self.places - xy
        facing_db = self.ahead_db * np.cos(np.arctan2(away[:, 1], away[:, 0]) - heading)
        distance_m = np.maximum(np.hypot(*(self.places - xy).T), 1.0)
        shadow = 4.0 * np.cos(self.waves @ xy + self.phases).mean(axis=1) * 2.0
        rssi = (
            -40.0
            - 32.0 * np.log10(distance_m)
            - self.loss_db
            + shadow
            + facing_db
            + chance.normal(0.0, fading_db, len(distance_m))
        )
        heard = np.flatnonzero(chance.random(len(rssi)) < 0.92 / (1.0 + np.exp(-(rssi + 87.0) / 2.0)))
        return Readings(
            tuple(self.bssids[k] for k in heard),
            np.round(rssi[heard]).astype(np.float32),
            np.zeros(len(heard), np.float32),
        )

    def moved(self, share: float, seed: int) -> "Radio":
        """The same after so many of the access points were moved to anywhere."""
        chance = np.random.default_rng(seed)
        places = self.places.copy()
        gone = chance.permutation(len(places))[: round(share * len(places))]
        places[gone] = places[chance.permutation(len(places))[: len(gone)]] + chance.normal(0, 15, (len(gone), 2))
        return replace(self, places=places)


def radio(seed: int = 0, access_points: int = 150, size_m: tuple[float, float] = (60.0, 30.0), mac: int = 0) -> Radio:
    """Access points in a building of this size and around it; their BSSIDs count from `mac`."""
    chance = np.random.default_rng(seed)
    bssids = tuple(f"02:00:00:00:{(mac + k) >> 8:02x}:{(mac + k) & 255:02x}" for k in range(access_points))
    places = chance.uniform((-15.0, -15.0), (size_m[0] + 15.0, size_m[1] + 15.0), (access_points, 2))
    waves = chance.normal(0, 0.25, (access_points, 8, 2))
    return Radio(bssids, places, chance.uniform(0, 15, access_points), waves, chance.uniform(0, 6.3, waves.shape[:2]))


def round_way(size_m: tuple[float, float] = (60.0, 30.0), rounds: float = 1.0) -> Floats:
    """(n, 3) poses along the corridors of a rectangle, `STEP_M` apart, from the corner at (0, 0)."""
    width, depth = size_m
    length = 2 * (width + depth)
    poses = []
    for s in np.arange(0.0, rounds * length, STEP_M) % length:
        if s < width:
            poses.append((s, 0.0, 0.0))
        elif s < width + depth:
            poses.append((width, s - width, np.pi / 2))
        elif s < 2 * width + depth:
            poses.append((2 * width + depth - s, depth, np.pi))
        else:
            poses.append((0.0, length - s, -np.pi / 2))
    return np.array(poses)


def serpentine_way(side_m: float, lane_m: float) -> Floats:
    """(n, 3) poses up and down the lanes of a square hall, `STEP_M` apart."""
    along = np.arange(0.0, side_m, STEP_M)
    lanes = []
    for k, x in enumerate(np.arange(0.0, side_m, lane_m)):
        up = k % 2 == 0
        y = along if up else along[::-1]
        lanes.append(np.column_stack([np.full(len(y), x), y, np.full(len(y), np.pi / 2 if up else -np.pi / 2)]))
    return np.vstack(lanes)


def radio_map(heard: Radio | None, way: Floats, seed: int = 1, floor: int = 0, receiver: str = "phone") -> BuildingMap:
    """The map of a drive along `way` (n, 3), each pose with the mean of two scans; of none where `heard` is None."""
    chance = np.random.default_rng(seed)
    nothing = np.empty((0, 2), np.float32)
    keyframes = [MapKeyframe(k * SECOND_NS, k * STEP_M, None, nothing, floor=floor) for k in range(len(way))]
    readings = [heard.readings(pose[:2], chance, 1.8, pose[2]) for pose in way] if heard else []
    fingerprints = [MapFingerprint(k * SECOND_NS, receiver, k, Pose2(), k * STEP_M, r) for k, r in enumerate(readings)]
    weights = dict.fromkeys((bssid for r in readings for bssid in r.bssids), 0.4)
    calibration = Calibration(WheelCalibration(np.zeros(4), np.full(4, 0.1)), {receiver: ReceiverOffset(0.0, 0.0)})
    grid = OccupancyGrid(np.zeros((1, 1), np.int8), 0.1, (0.0, 0.0))
    return BuildingMap(
        keyframes, way, np.zeros((len(way), 4)), {}, [], fingerprints, weights, calibration, grid
    )  # fmt: skip


def joined(a: BuildingMap, b: BuildingMap) -> BuildingMap:
    """The keyframes and fingerprints of two maps as one."""
    moved = [replace(f, keyframe=f.keyframe + len(a.keyframes)) for f in b.fingerprints]
    return replace(
        a,
        keyframes=[*a.keyframes, *b.keyframes],
        poses=np.vstack([a.poses, b.poses]),
        calibrations=np.vstack([a.calibrations, b.calibrations]),
        fingerprints=[*a.fingerprints, *moved],
        weights={**a.weights, **b.weights},
    )


def drive(
    belief: WifiBelief,
    heard: Radio,
    way: Floats,
    seed: int = 2,
    receiver: str = "phone",
    changes: Sequence[Change] = (),
    start: bool = True,
) -> None:
    """Drive along `way` (n, 3) with a scan at each pose, changed by `changes`; wheels err by 2 per cent.

    `start` is False where the belief has been at the first pose already.
    """
    chance = np.random.default_rng(seed)
    for k, pose in enumerate(way):
        if k:
            step = Pose2.of(way[k - 1]).between(Pose2.of(pose))
            noise = chance.normal(0, 1, 3) * np.sqrt(np.diag(STEP_COVARIANCE)) * 0.5
            belief.move(Pose2.of(step.array() + noise), STEP_COVARIANCE)
        elif not start:
            continue
        readings = heard.readings(pose[:2], chance, heading=pose[2])
        for change in changes:
            readings = change(readings)
        belief.add(receiver, readings)
