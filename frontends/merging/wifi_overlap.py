"""Where one map lies in another, by WiFi: the motion that brings like fingerprints together.

Each pair of a fingerprint and the most similar one of the other map votes, for each heading, for the translation that
makes their places one. All headings are tried, so that what else fits about as well is known.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, rigid_fit
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.joining import joined_receivers, joined_weights
from wayfi.frontends.maps.merging_config import MergingConfig
from wayfi.frontends.wifi.fingerprint_index import FingerprintIndex
from wayfi.frontends.wifi.receivers import ReceiverOffset

UNKNOWN_WEIGHT = 0.02  # of an access point that neither map has weighed: that of one that predicts no place
BLOCK = 512  # fingerprints that are compared with the other map at once: bounds the memory
REFINED = 10  # times by least squares from the motion that was voted for: it settles in three


@dataclass(frozen=True, slots=True, eq=False)
class LikePlaces:
    """Pairs of like fingerprints: their numbers (n,) in each map, places (n, 2) m in its frame, similarity (n,)."""

    a: NDArray[np.int64]
    b: NDArray[np.int64]
    place_a: Floats
    place_b: Floats
    similarity: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Overlap:
    """A pose of the frame of one map in that of another, and which of the pairs (n,) it brings together.

    `places` is how many independent ones these are, `spread_m` how far apart, `rival` the support of the next best
    motion over its own.
    """

    T_a_b: Pose2
    explained: NDArray[np.bool_]
    places: int
    spread_m: float
    rival: float


def like_places(a: BuildingMap, b: BuildingMap, sigma_db: float, config: MergingConfig) -> LikePlaces:
    """Each fingerprint of `b` with the most similar one of `a`, where they are similar at all."""
    index, receivers = FingerprintIndex(sigma_db), joined_receivers(a.calibration.receivers, b.calibration.receivers)
    for fingerprint in [*a.fingerprints, *b.fingerprints]:
        offset = receivers.get(fingerprint.receiver, ReceiverOffset(0.0, 0.0)).offset_db
        readings = fingerprint.readings
        index.add(replace(readings, rssi=readings.rssi - np.float32(offset)))
    index.weigh_all(joined_weights(a.weights, b.weights), UNKNOWN_WEIGHT)
    of_a, of_b = len(a.fingerprints), len(b.fingerprints)
    if not of_a or not of_b:
        none = np.zeros(0, np.int64)
        return LikePlaces(none, none, np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    best, highest = np.zeros(of_b, np.int64), np.zeros(of_b)
    for first in range(0, of_b, BLOCK):
        rows = np.arange(first, min(first + BLOCK, of_b))
        similarity = index.similarities(of_a + rows, np.arange(of_a))
        best[rows], highest[rows] = np.argmax(similarity, axis=1), similarity.max(axis=1)
    like = np.flatnonzero(highest >= config.min_similarity)
    places_a, places_b = a.fingerprint_poses()[:, :2], b.fingerprint_poses()[:, :2]
    return LikePlaces(best[like], like, places_a[best[like]], places_b[like], highest[like])


def find_overlap(pairs: LikePlaces, config: MergingConfig) -> Overlap | None:
    """The motion that brings most pairs together; None without pairs."""
    if len(pairs.a) == 0:
        return None
    middle = pairs.place_b.mean(axis=0)
    votes = _votes(pairs, middle, config)
    best = _refined(_as_motion(votes[0], middle), pairs, config)
    explained = _explained(best, pairs, config)
    support = max(int(explained.sum()), 1)
    rivals = (_explained(_refined(_as_motion(vote, middle), pairs, config), pairs, config) for vote in votes[1:])
    rival = max((int((other & ~explained).sum()) for other in rivals), default=0)
    places, spread_m = independent_places(pairs.place_b[explained], config.independent_m)
    return Overlap(best, explained, places, spread_m, rival / support)


def independent_places(places: Floats, apart_m: float) -> tuple[int, float]:
    """How many of (n, 2) places are `apart_m` from each other, and how far they lie apart at most (m)."""
    kept: list[Floats] = []
    for place in places:
        if all(math.hypot(*(place - other)) >= apart_m for other in kept):
            kept.append(place)
    chosen = np.array(kept).reshape(-1, 2)
    apart = np.hypot(*(chosen[:, None] - chosen[None]).transpose(2, 0, 1))
    return len(kept), float(apart.max(initial=0.0))


def _votes(pairs: LikePlaces, middle: Floats, config: MergingConfig) -> list[tuple[int, Pose2]]:
    """The best translation of each heading, by how many pairs vote for it, the most first; apart from each other.

    It is the pose that b has in a where its frame's origin were at `middle` of its places.
    """
    found = []
    for heading in np.arange(-math.pi, math.pi, config.heading_step):
        turned = Pose2(0.0, 0.0, float(heading)).transform(pairs.place_b - middle)
        wanted = pairs.place_a - turned
        cells = np.floor(wanted / config.cell_m).astype(np.int64)
        _, which, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        fullest = int(np.argmax(counts))
        x, y = wanted[which.ravel() == fullest].mean(axis=0)
        found.append((int(counts[fullest]), Pose2(float(x), float(y), float(heading))))
    return sorted(found, key=lambda vote: -vote[0])


def _as_motion(vote: tuple[int, Pose2], middle: Floats) -> Pose2:
    return vote[1] @ Pose2(-float(middle[0]), -float(middle[1]), 0.0)


def _refined(T: Pose2, pairs: LikePlaces, config: MergingConfig) -> Pose2:
    """The motion by least squares over the pairs that it explains, and again."""
    for _ in range(REFINED):
        near = _explained(T, pairs, config)
        if near.sum() < 2:
            return T
        T = rigid_fit(pairs.place_b[near], pairs.place_a[near])
    return T


def _explained(T: Pose2, pairs: LikePlaces, config: MergingConfig) -> NDArray[np.bool_]:
    return np.asarray(np.hypot(*(T.transform(pairs.place_b) - pairs.place_a).T) <= config.near_m)
