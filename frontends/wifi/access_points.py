"""How well each access point predicts place: its weight in the similarity of fingerprints.

An access point is worth its agreement, in the similarity's own terms exp(-(difference in dB)^2 / 2 sigma^2) and 0 where
only one of the two fingerprints heard it, between places near each other less that between places far apart. A hotspot
on the robot agrees everywhere, a weak or fickle access point nowhere: neither has weight. One that moved, wanders or is
gone agrees from one step to the next, but no longer where the robot is known to be back: there it loses its weight.
"""

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.wifi.fingerprint_index import FingerprintIndex

NEAR_M = 2.0  # of path: shadowing is alike over this length
MOVED_M = 0.25  # of path: fingerprints nearer than this repeat each other, as those of a robot that stands still do
FAR_M = 30.0  # of path: beyond the reach of the likeness of RSSI
PRIOR_NEAR, PRIOR_FAR, PRIOR_PAIRS = 0.6, 0.1, 2.0  # a common access point, until it is heard itself
REVISITS_TO_DOUBT = 10.0  # confirmed revisits that count as much as all that was heard in passing
MEMORY = 200.0  # pairs: what changes is believed within 100 m of path
LEAST = 0.02  # the weight of one that tells nothing: above 0, so that a similarity is always defined


class AccessPoints:
    """Learns the weights in an index from its fingerprints: as they come, and as places are found to be revisited."""

    def __init__(self, index: FingerprintIndex) -> None:
        self._index = index
        self._paths_m: list[float] = []
        self._latest = 0  # that was learnt from
        self._far_back = -1  # the newest that is FAR_M behind
        self._near = _Agreement(PRIOR_NEAR, PRIOR_PAIRS)
        self._far = _Agreement(PRIOR_FAR, PRIOR_PAIRS)
        self._again = _Agreement(0.0, 0.0)

    def learn(self, path_m: float) -> None:
        """Take in the index's newest fingerprint, heard at `path_m` of the path; to be called after every addition."""
        number = len(self._paths_m)
        self._paths_m.append(path_m)
        moved_m = path_m - self._paths_m[self._latest]
        while self._paths_m[self._far_back + 1] <= path_m - FAR_M:
            self._far_back += 1
        if moved_m >= MOVED_M:
            if moved_m <= NEAR_M:
                self._compare(self._latest, number, self._near)
            if self._far_back >= 0:
                self._compare(self._far_back, number, self._far)
            self._latest = number
        self._weigh(self._index.heard(number).aps)

    def confirm(self, a: int, b: int) -> None:
        """Fingerprints `a` and `b` are known to be of one place, though far apart on the path."""
        self._compare(a, b, self._again)

    def _compare(self, a: int, b: int, agreement: "_Agreement") -> None:
        """Learn how the access points agree that fingerprint `a` or `b` heard, and weigh them anew."""
        heard_a, heard_b = self._index.heard(a), self._index.heard(b)
        aps = np.union1d(heard_a.aps, heard_b.aps)
        common, in_a, in_b = np.intersect1d(heard_a.aps, heard_b.aps, assume_unique=True, return_indices=True)
        difference_db = np.full(len(aps), np.inf)
        difference_db[np.searchsorted(aps, common)] = heard_a.rssi[in_a] - heard_b.rssi[in_b]
        agreement.learn(aps, np.exp(-0.5 * (difference_db / self._index.sigma_db) ** 2))
        self._weigh(aps)

    def _weigh(self, aps: NDArray[np.int32]) -> None:
        near, _ = self._near.of(aps)
        far, _ = self._far.of(aps)
        again, revisits = self._again.of(aps)
        doubted = (REVISITS_TO_DOUBT * near + revisits * again) / (REVISITS_TO_DOUBT + revisits)
        self._index.weigh(aps, np.maximum(np.minimum(near, doubted) - far, LEAST))


class _Agreement:
    """The mean agreement of each access point over its last `MEMORY` pairs or so; it starts from a prior mean."""

    def __init__(self, prior: float, pairs: float) -> None:
        self._prior, self._prior_pairs = prior, pairs
        self._mean = np.empty(0)
        self._pairs = np.empty(0)

    def learn(self, aps: NDArray[np.int32], agreement: Floats) -> None:
        """One more pair of fingerprints, of which one or both heard `aps` (n,), with this (n,) agreement."""
        self._reserve(aps)
        self._pairs[aps] = np.minimum(self._pairs[aps] + 1.0, MEMORY)
        self._mean[aps] += (agreement - self._mean[aps]) / self._pairs[aps]

    def of(self, aps: NDArray[np.int32]) -> tuple[Floats, Floats]:
        """(n,) mean agreement of `aps` (n,), and (n,) how many pairs it rests on, the prior's included."""
        self._reserve(aps)
        return self._mean[aps], self._pairs[aps]

    def _reserve(self, aps: NDArray[np.int32]) -> None:
        missing = int(aps.max(initial=-1)) + 1 - len(self._mean)
        if missing > 0:
            missing += len(self._mean)
            self._mean = np.concatenate([self._mean, np.full(missing, self._prior)])
            self._pairs = np.concatenate([self._pairs, np.full(missing, self._prior_pairs)])
