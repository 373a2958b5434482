"""WiFi: scans become fingerprints of half a metre of path, and fingerprints heard before become loop candidates.

The sequence candidate follows Ismail et al. (arXiv 2206.08733): for every fingerprint of the window around i its k most
similar in the window around j, their similarity-weighted mean place, and the rigid motion T* (SVD) between the two
point sets. What the paper leaves to a fixed threshold is read off the robot's own way: a place is "heard before" if it
sounds more alike than places `alike_m` apart on the path just driven do.
"""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats, Pose2, between_all
from wayfi.frontends.fingerprints import FingerprintIndex, Readings
from wayfi.frontends.sequence import SequenceFit, fit_sequence


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
    min_similarity: float = option(0.3, "", "the paper's threshold, below which the robot's own does not fall")
    alike_m: float = option(1.5, "m", "closures are to be good to this; similarity at this distance is the threshold")
    alike_quantile: float = option(0.4, "", "of the similarities at that distance: places differ in how fast they fade")
    learn_from: int = option(10, "", "pairs that must be seen before the threshold means anything")
    candidate_every_m: float = option(0.4, "m", "one for each fingerprint of a receiver: single loops have few")
    window: int = option(40, "fingerprints", "the paper's w = 80 single scans, which were 33 m; half a metre each here")
    neighbours: int = option(2, "", "the paper's k, its best in its table")
    max_residual_m: float = option(3.0, "m", "the paper's acceptance")
    sigma_m: float = option(1.5, "m", "of a place named by one best match, as alike_m asks for it")
    independent_m: float = option(4.0, "m", "shadowing is alike over this length: so much path counts as one fix")


@dataclass(frozen=True, slots=True, eq=False)
class Fingerprint:
    """The mean of the scans over a stretch of path, placed at `T_keyframe_base` of `keyframe`."""

    number: int
    stamp_ns: int
    receiver: str
    keyframe: int
    T_keyframe_base: Pose2
    path_m: float
    readings: Readings


@dataclass(frozen=True, slots=True, eq=False)
class WifiCandidate:
    """Fingerprint `b` sounds like the earlier `a`. `T_a_b` relates their keyframes where a sequence fits, else None."""

    a: Fingerprint
    b: Fingerprint
    similarity: float
    sequence: SequenceFit | None


@dataclass(slots=True)
class _Open:
    """Scans of one receiver that are not a fingerprint yet."""

    start_path_m: float
    scans: list[tuple[int, int, Pose2, float, Readings]] = field(default_factory=list)


class Wifi:
    """Fingerprints as they come, and the loop candidates that they propose."""

    def __init__(self, config: WifiConfig) -> None:
        self._config = config
        self._index = FingerprintIndex(config.similarity_sigma_db)
        self._open: dict[str, _Open] = {}
        self._own: deque[float] = deque(maxlen=500)
        self._last_candidate_m = -math.inf
        self._path = np.empty(0)
        self.fingerprints: list[Fingerprint] = []

    def add_scan(
        self, stamp_ns: int, receiver: str, keyframe: int, T_keyframe_base: Pose2, path_m: float, readings: Readings
    ) -> Fingerprint | None:
        """Take a scan at its place; returns the fingerprint that it completes, if it does."""
        gathered = self._open.setdefault(receiver, _Open(path_m))
        gathered.scans.append((stamp_ns, keyframe, T_keyframe_base, path_m, readings))
        full = len(gathered.scans) >= self._config.fingerprint_scans
        if path_m - gathered.start_path_m < self._config.fingerprint_m and not full:
            return None
        del self._open[receiver]
        return self._complete(receiver, gathered)

    def similarity(self, fingerprint: Fingerprint) -> NDArray[np.float64]:
        """(number,) similarity of a fingerprint to each earlier one; also what the threshold is learnt from."""
        similarity = self._index.similarity(fingerprint.number)
        gap = fingerprint.path_m - self._path[: fingerprint.number]
        own = np.abs(gap - self._config.alike_m) < 0.3 * self._config.alike_m
        self._own.extend(
            float(similarity[j]) for j in np.flatnonzero(own) if self.fingerprints[j].receiver == fingerprint.receiver
        )
        return similarity

    @property
    def threshold(self) -> float:
        """The similarity above which two fingerprints are taken for one place; infinite until it is learnt."""
        if len(self._own) < self._config.learn_from:
            return math.inf
        return max(self._config.min_similarity, float(np.quantile(self._own, self._config.alike_quantile)))

    def candidate(self, b: Fingerprint, similarity: NDArray[np.float64], poses: Floats) -> WifiCandidate | None:
        """The best earlier place for `b`, if it sounds like one; `poses` (n, 3) are the keyframes' now."""
        if b.path_m - self._last_candidate_m < self._config.candidate_every_m:
            return None
        far = np.flatnonzero(b.path_m - self._path[: b.number] >= self._config.min_path_m)
        if len(far) == 0:
            return None
        a = self.fingerprints[int(far[np.argmax(similarity[far])])]
        if similarity[a.number] < self.threshold:
            return None
        self._last_candidate_m = b.path_m
        return WifiCandidate(a, b, float(similarity[a.number]), self._sequence(a, b, poses))

    def places(self, poses: Floats) -> Floats:
        """(m, 3) poses of all fingerprints in `map`, given the keyframes' (n, 3)."""
        return np.array([(Pose2.of(poses[f.keyframe]) @ f.T_keyframe_base).array() for f in self.fingerprints]).reshape(
            -1, 3
        )

    def _complete(self, receiver: str, gathered: _Open) -> Fingerprint | None:
        levels: dict[str, list[float]] = {}
        for *_, readings in gathered.scans:
            for bssid, rssi in zip(readings.bssids, readings.rssi.tolist(), strict=True):
                levels.setdefault(bssid, []).append(rssi)
        least = self._config.heard_share * len(gathered.scans)
        mean = {bssid: float(np.mean(rssi)) for bssid, rssi in levels.items() if len(rssi) >= least}
        if len(mean) < self._config.min_readings:
            return None
        merged = Readings(tuple(mean), np.array(list(mean.values()), np.float32), np.zeros(len(mean), np.float32), ())
        stamp_ns, keyframe, T, path_m, _ = gathered.scans[len(gathered.scans) // 2]
        fingerprint = Fingerprint(self._index.add(merged), stamp_ns, receiver, keyframe, T, path_m, merged)
        self.fingerprints.append(fingerprint)
        self._path = np.append(self._path, path_m)
        return fingerprint

    def _sequence(self, a: Fingerprint, b: Fingerprint, poses: Floats) -> SequenceFit | None:
        """The paper's T* between the window up to b and that around a; None if they do not match.

        b's window is trailing, so a's reaches as far to each side: it was driven either way.
        """
        window = self._config.window
        rows = np.arange(max(b.number - window, a.number + window // 2), b.number + 1)
        columns = np.arange(max(a.number - window, 0), min(a.number + window, rows[0] if len(rows) else 0))
        if len(rows) < window // 2 or len(columns) < window // 2:
            return None
        similarity = self._index.similarities(rows, columns)
        if float(np.mean(similarity.max(axis=1))) < self.threshold:
            return None
        fit = fit_sequence(
            similarity,
            self._in_frame(columns, a.keyframe, poses),
            self._in_frame(rows, b.keyframe, poses),
            self._config.neighbours,
            self._config.independent_m,
        )
        return fit if fit.residual_m < self._config.max_residual_m else None

    def _in_frame(self, numbers: NDArray[np.int64], keyframe: int, poses: Floats) -> Floats:
        """(n, 2) places of fingerprints in the frame of a keyframe."""
        places = np.array(
            [(Pose2.of(poses[f.keyframe]) @ f.T_keyframe_base).array() for f in (self.fingerprints[i] for i in numbers)]
        )
        return between_all(poses[keyframe], places)[:, :2]
