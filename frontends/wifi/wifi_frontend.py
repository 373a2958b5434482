"""Makes fingerprints of the scans over half a metre of path, and loop candidates of similar fingerprints.

A fingerprint is paired with the most similar earlier one. `self_similarity` estimates how far apart the two places may
be, and the fingerprints around the later place decide whether the pair is mutual. This replaces the sequence of Ismail
et al. (arXiv 2206.08733), which fits a rigid motion to two windows of fingerprints: its heading is wrong where the
window is straight or was driven the other way.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.wifi.access_points import AccessPoints
from wayfi.frontends.wifi.fingerprint_index import FingerprintIndex, Similar
from wayfi.frontends.wifi.fingerprints import Fingerprint, WifiCandidate
from wayfi.frontends.wifi.readings import PlacedWifiScan, Readings, mean_readings
from wayfi.frontends.wifi.receivers import ReceiverOffset, Receivers
from wayfi.frontends.wifi.self_similarity import SelfSimilarity
from wayfi.frontends.wifi.wifi_config import WifiConfig

_GAPS = 31  # fingerprints of a receiver whose spacing counts: enough for a median, few enough to follow the speed


class _AnchoredScan(NamedTuple):
    """A scan, and its place in the keyframe that was the newest when it was taken."""

    scan: PlacedWifiScan
    keyframe: int
    T_keyframe_base: Pose2


class WifiFrontend:
    """Gathers scans to fingerprints and proposes loop candidates between them."""

    def __init__(self, config: WifiConfig, receivers: Mapping[str, ReceiverOffset]) -> None:
        self._config = config
        self._index = FingerprintIndex(config.similarity_sigma_db)
        self._access_points = AccessPoints(self._index, config.access_points)
        self.receivers = Receivers(config.receivers, receivers)
        self._open: dict[str, list[_AnchoredScan]] = {}
        self._ended_m: dict[str, float] = {}
        self._last_m: dict[str, float] = {}
        self._gaps_m: dict[str, deque[float]] = {}
        self._self_similarity = SelfSimilarity(config.self_similarity)
        self._reach_m = config.self_similarity.reach_m
        self._held: deque[WifiCandidate] = deque()
        self._last_candidate_m = -math.inf
        self._far = 0  # the first fingerprint too near along the path to close a loop with the newest
        self.fingerprints: list[Fingerprint] = []

    def add_scan(self, scan: PlacedWifiScan, keyframe: int, T_keyframe_base: Pose2) -> Fingerprint | None:
        """Add a scan taken at `T_keyframe_base` of `keyframe`; returns the fingerprint that it completes, if any.

        While the robot stands still, each receiver completes one fingerprint at most.
        """
        receiver, point = scan.receiver, scan.point
        if point.path_m - self._ended_m.get(receiver, -math.inf) < self._config.still_m:
            return None
        anchored = _AnchoredScan(scan, keyframe, T_keyframe_base)
        scans = self._open.setdefault(receiver, [])
        length_m = point.path_m - scans[0].scan.point.path_m if scans else 0.0
        if length_m > self._config.split_at * self._config.fingerprint_m:
            self._open[receiver] = [anchored]
            return self._complete(receiver, scans) if length_m < self._reach_m else None
        scans.append(anchored)
        if length_m < self._config.fingerprint_m and len(scans) < self._config.fingerprint_scans:
            return None
        del self._open[receiver]
        self._ended_m[receiver] = point.path_m
        return self._complete(receiver, scans)

    def similar(self, fingerprint: Fingerprint) -> Similar:
        """The most similar of the earlier fingerprints that are far enough along the path to close a loop."""
        while self.fingerprints[self._far].path_m <= fingerprint.path_m - self._config.min_path_m:
            self._far += 1
        return self._index.similar(fingerprint.number, self._far)

    def candidate(self, b: Fingerprint, similar: Similar) -> WifiCandidate | None:
        """A candidate of `b` and the most similar earlier fingerprint, if they are likely to be near each other."""
        if b.path_m - self._last_candidate_m < self._config.candidate_every_m or len(similar.numbers) == 0:
            return None
        a, similarity = self.fingerprints[int(similar.numbers[0])], float(similar.similarity[0])
        if b.path_m - a.path_m < self._config.min_path_m:
            return None  # fingerprints of several receivers are not quite in the order of the path
        distance = self._self_similarity.distance(similarity, self._near_m(b.receiver))
        if distance.near < self._config.min_near:
            return None
        self._last_candidate_m = b.path_m
        return WifiCandidate(a, b, similarity, self._config.sigma_of_rms * distance.rms_m)

    def hold(self, candidate: WifiCandidate) -> None:
        """Hold a candidate until the path after its later place has been driven as well."""
        self._held.append(candidate)

    def released(self, at_end: bool = False) -> list[WifiCandidate]:
        """The held candidates whose neighbourhood has been driven by now; at the end, all of them."""
        driven_m = math.inf if at_end else self.fingerprints[-1].path_m
        released = []
        while self._held and driven_m - self._held[0].b.path_m >= self._config.neighbouring_m:
            candidate = self._held.popleft()
            released.append(replace(candidate, mutual=self._is_mutual(candidate)))
        return released

    def confirm(self, candidate: WifiCandidate) -> None:
        """Learn from the two fingerprints of an accepted candidate which access points agree."""
        self._access_points.confirm(candidate.a.number, candidate.b.number)

    def weights(self) -> dict[str, float]:
        """The present weight of each access point by its BSSID."""
        return self._index.weights()

    def _measure_gap(self, fingerprint: Fingerprint) -> None:
        """Note the path since the receiver's last fingerprint."""
        before_m = self._last_m.get(fingerprint.receiver)
        if before_m is not None:
            gaps_m = self._gaps_m.setdefault(fingerprint.receiver, deque(maxlen=_GAPS))
            gaps_m.append(fingerprint.path_m - before_m)
        self._last_m[fingerprint.receiver] = fingerprint.path_m

    def _near_m(self, receiver: str) -> float:
        """What counts as one place: of a slow scanner on a quick robot, as far as its next fingerprint and a half."""
        gaps_m = self._gaps_m.get(receiver)
        if not gaps_m:
            return self._config.near_m
        return max(self._config.near_m, self._config.near_gaps * float(np.median(gaps_m)))

    def _complete(self, receiver: str, scans: list[_AnchoredScan]) -> Fingerprint | None:
        readings = mean_readings([s.scan.readings for s in scans], self._config.heard_share * len(scans))
        if len(readings.bssids) < self._config.min_readings:
            return None
        middle = scans[len(scans) // 2]
        point = middle.scan.point
        self.receivers.learn(receiver, point.path_m, readings)
        return self.add(receiver, middle.keyframe, middle.T_keyframe_base, point, readings)

    def add(
        self, receiver: str, keyframe: int, T_keyframe_base: Pose2, point: PathPoint, readings: Readings
    ) -> Fingerprint:
        """Add the fingerprint of these readings, taken at `point` of the path: at `T_keyframe_base` of `keyframe`."""
        number = self._index.add(self.receivers.corrected(receiver, readings))
        fingerprint = Fingerprint(number, point.stamp_ns, receiver, keyframe, T_keyframe_base, point, readings)
        self._measure_gap(fingerprint)
        self.fingerprints.append(fingerprint)
        self._access_points.learn(fingerprint.path_m)
        self._learn_self_similarity(fingerprint)
        return fingerprint

    def _learn_self_similarity(self, fingerprint: Fingerprint) -> None:
        own = [f for f in self._neighbouring(fingerprint.number, self._reach_m) if f.receiver == fingerprint.receiver]
        here = fingerprint.point.T_path_base
        distance_m = np.array([here.distance(f.point.T_path_base) for f in own])
        self._self_similarity.add(self._similarities(fingerprint, own), distance_m)

    def _neighbouring(self, number: int, reach_m: float) -> list[Fingerprint]:
        """The fingerprints within `reach_m` of path of fingerprint `number`, itself left out."""
        path_m = self.fingerprints[number].path_m
        first = number
        while first > 0 and path_m - self.fingerprints[first - 1].path_m <= reach_m:
            first -= 1
        last = number
        while last + 1 < len(self.fingerprints) and self.fingerprints[last + 1].path_m - path_m <= reach_m:
            last += 1
        return [f for f in self.fingerprints[first : last + 1] if f.number != number]

    def _is_mutual(self, candidate: WifiCandidate) -> bool:
        """Whether a is no more similar to any place neighbouring b than to b."""
        neighbours = self._neighbouring(candidate.b.number, self._config.neighbouring_m)
        *to_neighbours, to_b = self._similarities(candidate.a, [*neighbours, candidate.b])
        return bool((np.array(to_neighbours) <= to_b).all())

    def _similarities(self, fingerprint: Fingerprint, others: list[Fingerprint]) -> Floats:
        """(n,) its similarity to each of the others, by the present weights of the access points."""
        columns = np.array([f.number for f in others], np.int64)
        similarities: Floats = self._index.similarities(np.array([fingerprint.number]), columns)[0]
        return similarities
