"""How well each access point predicts place: its weight in the similarity of fingerprints.

The agreement of an access point in two fingerprints is exp(-(difference in dB)^2 / 2 sigma^2), as in the similarity,
and 0 where only one of them heard it. Its weight is its mean agreement between places near each other, less that
between places far apart. A hotspot on the robot agrees everywhere, a weak or unsteady access point nowhere: both get no
weight. One that was moved or switched off agrees from one step to the next, but not where a place is revisited: the
agreement there lowers its weight.
"""

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.wifi.fingerprint_index import FingerprintIndex
from wayfi.frontends.wifi.wifi_config import AccessPointConfig


class AccessPoints:
    """Learns the weights in an index from its fingerprints, as they come and as revisited places are confirmed."""

    def __init__(self, index: FingerprintIndex, config: AccessPointConfig) -> None:
        self._index, self._config = index, config
        self._paths_m: list[float] = []
        self._latest = 0  # the newest fingerprint that was compared
        self._far_back = -1  # the newest that is `far_m` behind
        self._near = _Agreement(config.prior_near, config.prior_pairs, config.memory_pairs)
        self._far = _Agreement(config.prior_far, config.prior_pairs, config.memory_pairs)
        self._revisited = _Agreement(0.0, 0.0, config.memory_pairs)

    def learn(self, path_m: float) -> None:
        """Learn from the index's newest fingerprint, heard at `path_m` (m) of the path; after every addition."""
        config, number = self._config, len(self._paths_m)
        self._paths_m.append(path_m)
        moved_m = path_m - self._paths_m[self._latest]
        while self._paths_m[self._far_back + 1] <= path_m - config.far_m:
            self._far_back += 1
        if moved_m >= config.moved_m:
            if moved_m <= config.near_m:
                self._compare(self._latest, number, self._near)
            if self._far_back >= 0:
                self._compare(self._far_back, number, self._far)
            self._latest = number
        self._weigh(self._index.heard(number).aps)

    def confirm(self, a: int, b: int) -> None:
        """Learn from fingerprints `a` and `b` of one place that was revisited."""
        self._compare(a, b, self._revisited)

    def _compare(self, a: int, b: int, agreement: "_Agreement") -> None:
        """Learn the agreement of all access points that fingerprint `a` or `b` heard, and update their weights."""
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
        revisited, revisits = self._revisited.of(aps)
        passing = self._config.revisits
        blended = (passing * near + revisits * revisited) / (passing + revisits)
        self._index.weigh(aps, np.maximum(np.minimum(near, blended) - far, self._config.min_weight))


class _Agreement:
    """The mean agreement of each access point over about its last `memory` pairs; it starts from a prior mean."""

    def __init__(self, prior: float, prior_pairs: float, memory: float) -> None:
        self._prior, self._prior_pairs, self._memory = prior, prior_pairs, memory
        self._mean = np.empty(0)
        self._pairs = np.empty(0)

    def learn(self, aps: NDArray[np.int32], agreement: Floats) -> None:
        """Add a pair of fingerprints, of which one or both heard `aps` (n,), with this (n,) agreement."""
        self._reserve(aps)
        self._pairs[aps] = np.minimum(self._pairs[aps] + 1.0, self._memory)
        self._mean[aps] += (agreement - self._mean[aps]) / self._pairs[aps]

    def of(self, aps: NDArray[np.int32]) -> tuple[Floats, Floats]:
        """(n,) mean agreement of `aps` (n,), and the (n,) number of pairs behind it, the prior's included."""
        self._reserve(aps)
        return self._mean[aps], self._pairs[aps]

    def _reserve(self, aps: NDArray[np.int32]) -> None:
        missing = int(aps.max(initial=-1)) + 1 - len(self._mean)
        if missing > 0:
            missing += len(self._mean)
            self._mean = np.concatenate([self._mean, np.full(missing, self._prior)])
            self._pairs = np.concatenate([self._pairs, np.full(missing, self._prior_pairs)])
