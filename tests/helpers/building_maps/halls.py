"""Maps of drives around a hall whose walls, and access points, are known."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from building_maps.rounds import CONFIG
from graphs import PRIOR, STEP
from rooms import see

from wayfi.backend.graph.factors import BetweenFactor, Factor
from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.maps.building_map import BuildingMap, MapFingerprint, MapKeyframe
from wayfi.frontends.maps.optimising import drawn
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.wifi.readings import Readings
from wayfi.recordings.simulation.surfaces import box

LENGTH_M, WIDTH_M = 40.0, 24.0
ACCESS_POINTS = 14
STEP_M = 1.0
CEILING_DB, LIMIT_DBM = 18.0, -95.0  # what a ceiling takes, and what no receiver hears


def walls(seed: int = 0) -> Floats:
    """(n, 4) the ends of the walls of a hall and of the racks in it, which stand otherwise for each seed."""
    rng = np.random.default_rng(seed)
    racks = [box(x, y, x + w, y + h) for x, y, w, h in rng.uniform([8, 8, 1, 1], [30, 15, 4, 2.5], (7, 4))]
    niches = [box(x, -1.0, x + w, 0.6) for x, w in rng.uniform([2, 0.4], [38, 1.5], (8, 2))]
    return np.concatenate([box(0.0, 0.0, LENGTH_M, WIDTH_M), *racks, *niches])


@dataclass(frozen=True, slots=True, eq=False)
class Hall:
    """A hall with these walls, and access points that are named `name` and stand at (m, 2) places.

    `neighbour` is the hall on the next floor, whose access points are heard through the ceiling.
    """

    walls: Floats
    name: str
    places: Floats
    neighbour: "Hall | None" = None

    def heard(self, at: Pose2, rng: np.random.Generator) -> Readings:
        """What a receiver hears at a pose."""
        own, rssi = self.levels(at, rng)
        if self.neighbour is not None:
            others, through = self.neighbour.levels(at, rng)
            own, rssi = own + others, np.concatenate([rssi, through - CEILING_DB])
        audible = np.flatnonzero(rssi >= LIMIT_DBM)
        bssids = tuple(own[k] for k in audible)
        return Readings(bssids, rssi[audible].astype(np.float32), np.zeros(len(audible), np.float32))

    def levels(self, at: Pose2, rng: np.random.Generator) -> tuple[tuple[str, ...], Floats]:
        """The access points of this hall, and the level of each at a pose on its floor, dBm."""
        away_m = np.hypot(*(self.places - (at.x, at.y)).T)
        rssi = -40.0 - 25.0 * np.log10(np.maximum(away_m, 1.0)) + 2.0 * rng.standard_normal(len(away_m))
        return tuple(f"{self.name}:00:00:00:00:{k:02x}" for k in range(len(away_m))), rssi


def hall(seed: int = 0, name: str = "aa") -> Hall:
    """A hall, its racks and access points by the seed."""
    rng = np.random.default_rng(1000 + seed)
    return Hall(walls(seed), name, rng.uniform([0, 0], [LENGTH_M, WIDTH_M], (ACCESS_POINTS, 2)))


def around(first_m: float, length_m: float, back: bool = False, inset_m: float = 4.0) -> Floats:
    """(n, 3) poses each metre of a drive around the hall that begins `first_m` of the way, perhaps the other way round.

    It keeps `inset_m` from the walls.
    """
    wide, high = LENGTH_M - 2 * inset_m, WIDTH_M - 2 * inset_m
    corners = np.cumsum([0.0, wide, high, wide, high])
    poses = []
    for s in np.arange(0.0, length_m, STEP_M):
        at = (first_m + (-s if back else s)) % corners[-1]
        side = int(np.searchsorted(corners, at, side="right")) - 1
        along, heading = at - corners[side], side * math.pi / 2
        x0, y0 = [(0.0, 0.0), (wide, 0.0), (wide, high), (0.0, high)][side]
        x, y = x0 + along * math.cos(heading), y0 + along * math.sin(heading)
        poses.append(Pose2.of((x + inset_m, y + inset_m, heading + (math.pi if back else 0.0))).array())
    return np.array(poses)


def map_of(place: Hall, truth: Floats, seed: int = 0, laser: bool = True, wifi: bool = True) -> BuildingMap:
    """The map of a drive along (n, 3) true poses, in the frame of its first; steps err by what their factors say."""
    rng = np.random.default_rng(seed)
    steps = [Pose2.of(a).between(Pose2.of(b)) for a, b in pairwise(truth)]
    noisy = [Pose2.of(s.array() + 0.1 * np.sqrt(np.diag(STEP)) * rng.standard_normal(3)) for s in steps]
    factors: dict[int, Factor] = {k: BetweenFactor(k, k + 1, step, STEP) for k, step in enumerate(noisy)}
    poses = compose_all(Pose2.of(truth[0]).inverse().array(), truth)
    scans = [see(place.walls, Pose2.of(pose), rng) if laser else None for pose in truth]
    keyframes = [
        MapKeyframe(k * SECOND_NS, k * STEP_M, scan, (scan.points if scan else np.empty((0, 2))).astype(np.float32))
        for k, scan in enumerate(scans)
    ]
    fingerprints = [
        MapFingerprint(k * SECOND_NS, "phone", k, Pose2(), k * STEP_M, place.heard(Pose2.of(pose), rng))
        for k, pose in enumerate(truth)
    ]
    weights = dict.fromkeys(fingerprints[0].readings.bssids, 0.5) if wifi else {}
    return BuildingMap(
        keyframes, poses, np.zeros((len(poses), 4)), factors, [], fingerprints if wifi else [], weights,
        Calibration(PRIOR, {}), drawn(keyframes, poses, CONFIG.grid),
    )  # fmt: skip
