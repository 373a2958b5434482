"""WiFi fingerprints and how similar they are.

Similarity after Ismail et al. (arXiv 2206.08733): sim(i, j) = H / (L_i + L_j - H) times the mean over the H common
access points of exp(-(f_i - f_j)^2 / 2 sigma^2). The paper prints a product in the place of the mean; over 40 access
points a product is nearly zero for any pair, and its threshold of 0.3 could never hold. That is the sum of the
exponentials over the common access points, divided by the number that either heard; here each access point counts in
both by its weight, which is 1 until `weigh` sets it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.frontends.wifi.postings import Postings
from wayfi.frontends.wifi.readings import LOWEST_DBM, Readings

_GROWTH = 2  # of arrays when they are full: each value is copied about once
EXAMINED = 512  # in 0.1 to 0.5 ms; of 100,000 stored they hold one 0.994 times as similar as the best, or more
MOST_SIMILAR = 64  # one would do for a candidate; so many are drawn


@dataclass(frozen=True, slots=True, eq=False)
class Heard:
    """(n,) numbers of the access points that a fingerprint heard, rising, and their (n,) RSSI in dBm."""

    aps: NDArray[np.int32]
    rssi: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Similar:
    """(m,) `numbers` of fingerprints and their (m,) similarity to one, falling; of equals the earliest comes first."""

    numbers: NDArray[np.int64]
    similarity: NDArray[np.float64]


class FingerprintIndex:
    """Fingerprints 0, 1, ... and what each of them heard; access points are numbered as they are first heard."""

    def __init__(self, sigma_db: float) -> None:
        self.sigma_db = sigma_db
        self.size = 0
        self._numbers: dict[str, int] = {}
        self._weights = np.ones(256)
        self._starts = np.zeros(257, np.int64)
        self._aps = np.empty(4096, np.int32)
        self._rssi = np.empty(4096, np.float32)
        self._postings = Postings(sigma_db)
        self._posted = 0

    def add(self, readings: Readings) -> int:
        """Store a fingerprint; returns its number."""
        aps = np.array([self._numbers.setdefault(b, len(self._numbers)) for b in readings.bssids], np.int32)
        order = np.argsort(aps)
        start, end = self._starts[self.size], self._starts[self.size] + len(aps)
        self._reserve(int(end))
        self._aps[start:end], self._rssi[start:end] = aps[order], readings.rssi[order]
        self.size += 1
        self._starts[self.size] = end
        return self.size - 1

    def heard(self, number: int) -> Heard:
        """What fingerprint `number` heard."""
        span = slice(self._starts[number], self._starts[number + 1])
        return Heard(self._aps[span], self._rssi[span])

    def weigh(self, aps: NDArray[np.int32], weights: NDArray[np.float64]) -> None:
        """Set the (n,) `weights` of the access points `aps` (n,), each above 0."""
        self._weights[aps] = weights

    def weigh_all(self, weights: Mapping[str, float], unknown: float) -> None:
        """Set the weight of every access point by its BSSID, `unknown` where none is given; each above 0."""
        for bssid, number in self._numbers.items():
            self._weights[number] = weights.get(bssid, unknown)

    def weights(self) -> dict[str, float]:
        """The weight of each access point by its BSSID."""
        return {bssid: float(self._weights[number]) for bssid, number in self._numbers.items()}

    def similar(self, number: int, before: int) -> Similar:
        """The `MOST_SIMILAR` to fingerprint `number` of the fingerprints below `before`, which is `number` at most.

        The cost is bounded however many are stored: the similarity is computed of the `EXAMINED` that have most in
        common with it by `Postings`, which reads no more than the newest entries of a long drive. Otherwise the result
        is exact down to exp(-2): two fingerprints whose common access points all differ by more than 2 sigma are less
        similar than that.
        """
        while self._posted < before:
            heard = self.heard(self._posted)
            self._postings.add(self._posted, heard.aps, heard.rssi)
            self._posted += 1
        heard = self.heard(number)
        weights = self._weights[heard.aps]
        order = np.argsort(-weights * (heard.rssi - LOWEST_DBM), kind="stable")
        examined = self._postings.overlap(heard.aps[order], heard.rssi[order], weights[order], before, EXAMINED).numbers
        similarity = self.similarities(np.array([number]), examined)[0]
        best = np.argsort(-similarity, kind="stable")[:MOST_SIMILAR]
        return Similar(examined[best], similarity[best])

    def similarity(self, number: int) -> NDArray[np.float64]:
        """(number,) similarity of fingerprint `number` to each earlier one."""
        similarity: NDArray[np.float64] = self.similarities(np.array([number]), np.arange(number))[0]
        return similarity

    def similarities(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float64]:
        """(rows, columns) similarity of each fingerprint of `rows` to each of `columns`."""
        out = np.zeros((len(rows), len(columns)))
        _similarities(out, rows, columns, self._aps, self._rssi, self._starts, self._weights, self.sigma_db)
        return out

    def _reserve(self, readings: int) -> None:
        if readings > len(self._rssi):
            self._aps = np.resize(self._aps, _GROWTH * readings)
            self._rssi = np.resize(self._rssi, _GROWTH * readings)
        if self.size + 2 > len(self._starts):
            self._starts = np.resize(self._starts, _GROWTH * len(self._starts))
        if len(self._numbers) > len(self._weights):
            new = np.ones(_GROWTH * len(self._numbers) - len(self._weights))
            self._weights = np.concatenate([self._weights, new])


@njit(cache=True)
def _similarities(
    out: NDArray[np.float64],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    aps: NDArray[np.int32],
    rssi: NDArray[np.float32],
    starts: NDArray[np.int64],
    weights: NDArray[np.float64],
    sigma_db: float,
) -> None:
    """Fill `out` (rows, columns)."""
    scale = -0.5 / (sigma_db * sigma_db)
    heard = np.full(weights.shape[0], np.nan, np.float32)
    for r in range(rows.shape[0]):
        own = 0.0
        for i in range(starts[rows[r]], starts[rows[r] + 1]):
            heard[aps[i]] = rssi[i]
            own += weights[aps[i]]
        for c in range(columns.shape[0]):
            common, either = 0.0, own
            for i in range(starts[columns[c]], starts[columns[c] + 1]):
                difference = heard[aps[i]] - rssi[i]
                if np.isnan(difference):
                    either += weights[aps[i]]
                else:
                    common += weights[aps[i]] * math.exp(scale * difference * difference)
            out[r, c] = common / either if either > 0.0 else 0.0
        for i in range(starts[rows[r]], starts[rows[r] + 1]):
            heard[aps[i]] = np.nan
