"""WiFi: scans become fingerprints of half a metre of path, and fingerprints heard before become loop candidates.

A fingerprint is paired with the most similar earlier one. How far apart the two places may be is read off the robot's
own path (see self_similarity), and the fingerprints around them decide whether they are each other's best: the sequence
of Ismail et al. (arXiv 2206.08733) without its rigid motion, whose heading is wrong where the window is straight or was
driven the other way.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.wifi.access_points import AccessPoints
from wayfi.frontends.wifi.fingerprints import FingerprintIndex, Readings, Similar
from wayfi.frontends.wifi.receivers import ReceiverOffset, Receivers
from wayfi.frontends.wifi.self_similarity import REACH_M, SelfSimilarity

_STILL_M = 0.02
_LONGEST = 2  # times its usual length: scans further apart than this are fingerprints of their own
_SIGMAS_OF_RMS = 0.5  # two axes share the rms; that it is the best match takes half of the variance away again


@dataclass(frozen=True)
class WifiConfig:
    """Fingerprints, their similarity, and loop candidates."""

    enabled: bool = option(True, "", "false runs on wheels and LiDAR alone")
    similarity_sigma_db: float = option(6.0, "dB", "the paper's sigma^2 = 36 dB^2")
    fingerprint_m: float = option(0.5, "m", "the mean over half a metre beats single scans, which fade")
    fingerprint_scans: int = option(20, "", "a robot that stands still needs no more for one mean")
    heard_share: float = option(0.25, "", "an access point heard in fewer of a fingerprint's scans is chance")
    min_readings: int = option(4, "", "fewer access points name no place")
    min_path_m: float = option(30.0, "m", "nearer along the path a closure says nothing new (the paper: 50)")
    near_m: float = option(3.0, "m", "places nearer than this count as one: closures are to be good to this")
    min_near: float = option(0.6, "", "how likely they must be that near, by the robot's own path")
    candidate_every_m: float = option(0.4, "m", "one for each fingerprint of a receiver: single loops have few")
    neighbouring_m: float = option(
        4.0, "m", "of path each way from the later place, none more like the earlier than it is"
    )
    independent_m: float = option(10.0, "m", "shadowing is alike over this length: so much path counts as one fix")


@dataclass(frozen=True, slots=True, eq=False)
class Fingerprint:
    """The mean of the scans over a stretch of path, placed at `T_keyframe_base` of `keyframe`."""

    number: int
    stamp_ns: int
    receiver: str
    keyframe: int
    T_keyframe_base: Pose2
    point: PathPoint
    readings: Readings

    @property
    def path_m(self) -> float:
        """How far the robot had driven."""
        return self.point.path_m

    @property
    def place(self) -> Floats:
        """(2,) m where it was taken, in its keyframe."""
        return np.array([self.T_keyframe_base.x, self.T_keyframe_base.y])


@dataclass(frozen=True, slots=True, eq=False)
class WifiCandidate:
    """Fingerprint `b` sounds like the earlier `a`: one place, to `sigma_m` along each axis.

    `mutual` says whether, of the places beside b, it is b that sounds most like a.
    """

    a: Fingerprint
    b: Fingerprint
    similarity: float
    sigma_m: float
    mutual: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class _PlacedScan:
    """A scan of one receiver, where it was taken."""

    stamp_ns: int
    keyframe: int
    T_keyframe_base: Pose2
    point: PathPoint
    readings: Readings


class WifiFrontend:
    """Fingerprints as they come, and the loop candidates that they propose."""

    def __init__(self, config: WifiConfig, receivers: Mapping[str, ReceiverOffset]) -> None:
        self._config = config
        self._index = FingerprintIndex(config.similarity_sigma_db)
        self._access_points = AccessPoints(self._index)
        self.receivers = Receivers(receivers)
        self._open: dict[str, list[_PlacedScan]] = {}
        self._ended_m: dict[str, float] = {}
        self._self_similarity = SelfSimilarity(config.near_m)
        self._held: deque[WifiCandidate] = deque()
        self._last_candidate_m = -math.inf
        self._path_m = np.empty(64)
        self._far = 0
        self.fingerprints: list[Fingerprint] = []

    def add_scan(
        self, stamp_ns: int, receiver: str, keyframe: int, T_keyframe_base: Pose2, point: PathPoint, readings: Readings
    ) -> Fingerprint | None:
        """Take a scan at its place; returns the fingerprint that it completes, if it does.

        Where a robot stands, one fingerprint of a receiver says it all.
        """
        if point.path_m - self._ended_m.get(receiver, -math.inf) < _STILL_M:
            return None
        scan = _PlacedScan(stamp_ns, keyframe, T_keyframe_base, point, readings)
        scans = self._open.setdefault(receiver, [])
        if scans and point.path_m - scans[0].point.path_m > _LONGEST * self._config.fingerprint_m:
            self._open[receiver] = [scan]
            return self._complete(receiver, scans) if point.path_m - scans[0].point.path_m < REACH_M else None
        scans.append(scan)
        long_enough = point.path_m - scans[0].point.path_m >= self._config.fingerprint_m
        if not long_enough and len(scans) < self._config.fingerprint_scans:
            return None
        del self._open[receiver]
        self._ended_m[receiver] = point.path_m
        return self._complete(receiver, scans)

    def similar(self, fingerprint: Fingerprint) -> Similar:
        """The most similar of the fingerprints that may close a loop; learns also what its own path teaches."""
        own = [f for f in self._beside(fingerprint.number, REACH_M) if f.receiver == fingerprint.receiver]
        here = fingerprint.point.T_path_base
        self._self_similarity.add(
            self._similarities(fingerprint, own), np.array([here.distance(f.point.T_path_base) for f in own])
        )
        while self._path_m[self._far] <= fingerprint.path_m - self._config.min_path_m:
            self._far += 1
        return self._index.similar(fingerprint.number, self._far)

    def candidate(self, b: Fingerprint, similar: Similar) -> WifiCandidate | None:
        """The best earlier place for `b`, if it sounds near enough."""
        if b.path_m - self._last_candidate_m < self._config.candidate_every_m or len(similar.numbers) == 0:
            return None
        a, similarity = self.fingerprints[int(similar.numbers[0])], float(similar.similarity[0])
        if b.path_m - a.path_m < self._config.min_path_m:
            return None  # of another receiver, whose fingerprints are late
        distance = self._self_similarity.distance(similarity)
        if distance.near < self._config.min_near:
            return None
        self._last_candidate_m = b.path_m
        return WifiCandidate(a, b, similarity, _SIGMAS_OF_RMS * distance.rms_m)

    def hold(self, candidate: WifiCandidate) -> None:
        """Keep a candidate until the path beside its later place has been driven as well."""
        self._held.append(candidate)

    def released(self, at_end: bool = False) -> list[WifiCandidate]:
        """The held candidates whose surroundings are known by now (`at_end`: as well as they ever will be)."""
        driven_m = math.inf if at_end else self.fingerprints[-1].path_m
        released = []
        while self._held and driven_m - self._held[0].b.path_m >= self._config.neighbouring_m:
            candidate = self._held.popleft()
            released.append(replace(candidate, mutual=self._is_mutual(candidate)))
        return released

    def confirm(self, candidate: WifiCandidate) -> None:
        """The two fingerprints are believed to be of one place: learn which access points say so."""
        self._access_points.confirm(candidate.a.number, candidate.b.number)

    def places(self, poses: Floats) -> Floats:
        """(m, 3) poses of all fingerprints in `map`, given the keyframes' (n, 3)."""
        return np.array([(Pose2.of(poses[f.keyframe]) @ f.T_keyframe_base).array() for f in self.fingerprints]).reshape(
            -1, 3
        )

    def _complete(self, receiver: str, scans: list[_PlacedScan]) -> Fingerprint | None:
        levels: dict[str, list[float]] = {}
        for scan in scans:
            for bssid, rssi in zip(scan.readings.bssids, scan.readings.rssi.tolist(), strict=True):
                levels.setdefault(bssid, []).append(rssi)
        least = self._config.heard_share * len(scans)
        mean = {bssid: sum(rssi) / len(rssi) for bssid, rssi in levels.items() if len(rssi) >= least}
        if len(mean) < self._config.min_readings:
            return None
        heard = Readings(tuple(mean), np.array(list(mean.values()), np.float32), np.zeros(len(mean), np.float32), ())
        middle = scans[len(scans) // 2]
        self.receivers.learn(receiver, middle.point.path_m, heard)
        number = self._index.add(self.receivers.corrected(receiver, heard))
        fingerprint = Fingerprint(
            number, middle.stamp_ns, receiver, middle.keyframe, middle.T_keyframe_base, middle.point, heard
        )
        self._append(fingerprint)
        self._access_points.learn(fingerprint.path_m)
        return fingerprint

    def _append(self, fingerprint: Fingerprint) -> None:
        if fingerprint.number == len(self._path_m):
            self._path_m = np.resize(self._path_m, 2 * len(self._path_m))
        self._path_m[fingerprint.number] = fingerprint.path_m
        self.fingerprints.append(fingerprint)

    def _beside(self, number: int, reach_m: float) -> list[Fingerprint]:
        """The fingerprints within `reach_m` of path of fingerprint `number`, itself left out."""
        path_m = self.fingerprints[number].path_m
        first = number
        while first > 0 and path_m - self._path_m[first - 1] <= reach_m:
            first -= 1
        last = number
        while last + 1 < len(self.fingerprints) and self._path_m[last + 1] - path_m <= reach_m:
            last += 1
        return [f for f in self.fingerprints[first : last + 1] if f.number != number]

    def _is_mutual(self, candidate: WifiCandidate) -> bool:
        """Whether a sounds no more like any place beside b than like b."""
        beside = self._beside(candidate.b.number, self._config.neighbouring_m)
        *like_beside, like_b = self._similarities(candidate.a, [*beside, candidate.b])
        return bool((np.array(like_beside) <= like_b).all())

    def _similarities(self, fingerprint: Fingerprint, others: list[Fingerprint]) -> Floats:
        """(n,) how similar it is to each of the others, as access points are weighed now."""
        columns = np.array([f.number for f in others], np.int64)
        similarities: Floats = self._index.similarities(np.array([fingerprint.number]), columns)[0]
        return similarities
