"""WiFi fingerprints and how similar they are, over an inverted index BSSID -> fingerprints.

Similarity after Ismail et al. (arXiv 2206.08733): sim(i, j) = H / (L_i + L_j - H) times the mean over the H common
access points of exp(-(f_i - f_j)^2 / 2 sigma^2). The paper prints a product in the place of the mean; over 40 access
points a product is nearly zero for any pair, and its threshold of 0.3 could never hold.
"""

import re
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import WifiScan

_BSSID = re.compile(r"^[0-9a-f]{2}(:[0-9a-f]{2}){5}$")
_GROWTH = 2


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """The usable readings of one WiFi scan, strongest first where a BSSID repeats; and why others were dropped."""

    bssids: tuple[str, ...]
    rssi: NDArray[np.float32]
    age_s: NDArray[np.float32]
    dropped: tuple[DropReason, ...]


def usable_readings(scan: WifiScan) -> Readings:
    """Leave out malformed BSSIDs and RSSI outside of [-120, 0] dBm; of a repeated BSSID the strongest reading stays."""
    kept: dict[str, tuple[float, float]] = {}
    dropped = []
    for bssid, rssi, age in zip(scan.bssids, scan.rssi.tolist(), scan.age_s.tolist(), strict=True):
        if not _BSSID.match(bssid):
            dropped.append(DropReason.MALFORMED_BSSID)
        elif not -120.0 <= rssi <= 0.0:
            dropped.append(DropReason.ABSURD_RSSI)
        elif bssid not in kept or rssi > kept[bssid][0]:
            kept[bssid] = (rssi, age if 0.0 <= age < 60.0 else 0.0)
    rssi_age = np.array(list(kept.values()), np.float32).reshape(-1, 2)
    return Readings(tuple(kept), rssi_age[:, 0], rssi_age[:, 1], tuple(dropped))


class FingerprintIndex:
    """Fingerprints 0, 1, ... and, for each BSSID, those that heard it.

    Similarity to all comes at the cost of what is shared.
    """

    def __init__(self, sigma_db: float) -> None:
        self._sigma_db = sigma_db
        self._ids: dict[str, int] = {}
        self._heads = np.full(256, -1, np.int64)
        self._fingerprint = np.empty(4096, np.int32)
        self._rssi = np.empty(4096, np.float32)
        self._bssid = np.empty(4096, np.int32)
        self._next = np.empty(4096, np.int64)
        self._starts = np.zeros(257, np.int64)
        self._postings = 0
        self.size = 0

    def add(self, readings: Readings) -> int:
        """Store a fingerprint; returns its number."""
        ids, rssi = self._sorted(readings)
        self._reserve(len(ids))
        for bssid, level in zip(ids, rssi, strict=True):
            p = self._postings
            self._fingerprint[p], self._rssi[p], self._bssid[p] = self.size, level, bssid
            self._next[p], self._heads[bssid] = self._heads[bssid], p
            self._postings += 1
        self.size += 1
        self._starts[self.size] = self._postings
        return self.size - 1

    def similarity(self, number: int) -> NDArray[np.float64]:
        """(number,) similarity of fingerprint `number` to each earlier one."""
        lo, hi = self._starts[number], self._starts[number + 1]
        return _similarity_to_all(
            self._bssid[lo:hi], self._rssi[lo:hi], self._heads, self._next, self._fingerprint, self._rssi,
            self._starts, number, self._sigma_db,
        )  # fmt: skip

    def similarities(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float64]:
        """(rows, columns) similarity of each fingerprint of `rows` to each of `columns`."""
        return _similarity_matrix(rows, columns, self._bssid, self._rssi, self._starts, self._sigma_db)

    def _sorted(self, readings: Readings) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        ids = np.array([self._ids.setdefault(b, len(self._ids)) for b in readings.bssids], np.int64)
        order = np.argsort(ids, kind="stable")
        return ids[order], readings.rssi[order]

    def _reserve(self, readings: int) -> None:
        if self._postings + readings > len(self._rssi):
            size = _GROWTH * len(self._rssi) + readings
            for name in ("_fingerprint", "_rssi", "_bssid", "_next"):
                setattr(self, name, np.resize(getattr(self, name), size))
        if self.size + 2 > len(self._starts):
            self._starts = np.resize(self._starts, _GROWTH * len(self._starts))
        if len(self._ids) > len(self._heads):
            grown = np.full(_GROWTH * len(self._ids), -1, np.int64)
            grown[: len(self._heads)] = self._heads
            self._heads = grown


@njit(cache=True)
def _similarity_to_all(
    bssids: NDArray[np.int32],
    levels: NDArray[np.float32],
    heads: NDArray[np.int64],
    following: NDArray[np.int64],
    fingerprint: NDArray[np.int32],
    rssi: NDArray[np.float32],
    starts: NDArray[np.int64],
    number: int,
    sigma_db: float,
) -> NDArray[np.float64]:
    total, common = np.zeros(number), np.zeros(number)
    scale = -0.5 / (sigma_db * sigma_db)
    for i in range(bssids.shape[0]):
        p = heads[bssids[i]]
        while p >= 0:
            other = fingerprint[p]
            if other < number:
                difference = levels[i] - rssi[p]
                total[other] += np.exp(scale * difference * difference)
                common[other] += 1
            p = following[p]
    for other in range(number):
        if common[other] > 0:
            length = starts[other + 1] - starts[other]
            total[other] /= bssids.shape[0] + length - common[other]
    return total


@njit(cache=True)
def _similarity_matrix(
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    bssid: NDArray[np.int32],
    rssi: NDArray[np.float32],
    starts: NDArray[np.int64],
    sigma_db: float,
) -> NDArray[np.float64]:
    out = np.zeros((rows.shape[0], columns.shape[0]))
    scale = -0.5 / (sigma_db * sigma_db)
    for r in range(rows.shape[0]):
        a0, a1 = starts[rows[r]], starts[rows[r] + 1]
        for c in range(columns.shape[0]):
            a, b = a0, starts[columns[c]]
            b0, b1 = b, starts[columns[c] + 1]
            total, common = 0.0, 0
            while a < a1 and b < b1:
                if bssid[a] == bssid[b]:
                    difference = rssi[a] - rssi[b]
                    total += np.exp(scale * difference * difference)
                    common += 1
                    a += 1
                    b += 1
                elif bssid[a] < bssid[b]:
                    a += 1
                else:
                    b += 1
            if common > 0:
                out[r, c] = total / (a1 - a0 + b1 - b0 - common)
    return out
