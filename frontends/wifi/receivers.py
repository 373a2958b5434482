"""How many dB each receiver reads above the first: two phones on a robot hear the same access point differently.

Fingerprints of two receivers from one place of the path differ by their receivers' offsets, and by fading. The median
over the common access points measures the difference once; a Kalman filter weighs such measurements. Only the stronger
half of the access points counts: of the weak ones a receiver reports those that fading has lifted.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.wifi.readings import Readings

PRIOR_SIGMA_DB = 4.0  # phones of one kind were seen 2 to 4 dB apart
ONE_PLACE_M = 1.0  # of path: RSSI changes little over it, and fading is new after it
LEAST_COMPARED = 4  # access points
FADING_DB = 5.0  # by which two readings of one access point differ at random
WALK_DB_PER_SQRT_M = 0.05  # what hands and heat change: half a dB in 100 m


@dataclass(frozen=True, slots=True)
class ReceiverOffset:
    """How many dB a receiver reads above the reference, which has offset and sigma 0."""

    offset_db: float
    sigma_db: float


class Receivers:
    """The offsets of the receivers; the first that is heard is the reference, unless some are `known` from before."""

    def __init__(self, known: Mapping[str, ReceiverOffset] | None = None) -> None:
        known = known or {}
        self._number = {receiver: number for number, receiver in enumerate(known)}
        self._offset_db: Floats = np.array([offset.offset_db for offset in known.values()])
        self._covariance: Floats = np.diag([offset.sigma_db**2 for offset in known.values()])
        self._latest: dict[str, tuple[float, Readings]] = {}
        self._compared_m: dict[frozenset[str], float] = {}
        self._path_m = math.inf

    @property
    def offsets(self) -> dict[str, ReceiverOffset]:
        """What is believed of each receiver now."""
        sigma_db = np.sqrt(np.diag(self._covariance))
        return {r: ReceiverOffset(float(self._offset_db[n]), float(sigma_db[n])) for r, n in self._number.items()}

    def learn(self, receiver: str, path_m: float, readings: Readings) -> None:
        """Take in what `receiver` heard at `path_m` of the path, not corrected."""
        self._walk(path_m)
        self._introduce(receiver)
        for other, (other_m, other_readings) in self._latest.items():
            pair = frozenset((receiver, other))
            compared_m = self._compared_m.get(pair, -math.inf)
            if other != receiver and abs(path_m - other_m) <= ONE_PLACE_M <= path_m - compared_m:
                difference_db = stronger_differences(readings, other_readings)
                if len(difference_db) >= LEAST_COMPARED:
                    self._compared_m[pair] = path_m
                    self._measure(self._number[receiver], self._number[other], difference_db)
        self._latest[receiver] = (path_m, readings)

    def corrected(self, receiver: str, readings: Readings) -> Readings:
        """`readings` of `receiver` as the reference would read them, as far as is known."""
        self._introduce(receiver)
        return replace(readings, rssi=readings.rssi - np.float32(self._offset_db[self._number[receiver]]))

    def _introduce(self, receiver: str) -> None:
        if receiver in self._number:
            return
        others = len(self._number)
        covariance = np.zeros((others + 1, others + 1))
        covariance[:others, :others] = self._covariance.reshape(others, others)
        covariance[others, others] = PRIOR_SIGMA_DB**2 if others else 0.0
        self._number[receiver] = others
        self._offset_db, self._covariance = np.append(self._offset_db, 0.0), covariance

    def _walk(self, path_m: float) -> None:
        """Offsets may have changed on the way to `path_m`; the reference is what it is."""
        moved_m = max(0.0, path_m - self._path_m)
        self._path_m = path_m if math.isinf(self._path_m) else max(self._path_m, path_m)
        changing = np.diag(self._covariance) > 0.0
        self._covariance += np.diag(np.where(changing, WALK_DB_PER_SQRT_M**2 * moved_m, 0.0))

    def _measure(self, a: int, b: int, difference_db: Floats) -> None:
        """Update by what receiver `a` was seen to read above `b`; the variance is that of a median."""
        towards = np.zeros(len(self._offset_db))
        towards[[a, b]] = 1.0, -1.0
        variance = math.pi / 2 * FADING_DB**2 / len(difference_db)
        innovation = float(np.median(difference_db)) - towards @ self._offset_db
        gain = self._covariance @ towards / (towards @ self._covariance @ towards + variance)
        self._offset_db = self._offset_db + gain * innovation
        self._covariance = self._covariance - np.outer(gain, towards @ self._covariance)


def stronger_differences(a: Readings, b: Readings) -> Floats:
    """(n,) dB that `a` reads above `b`, of the stronger half of the access points that both heard."""
    rssi_b = dict(zip(b.bssids, b.rssi.tolist(), strict=True))
    pairs = [(rssi, rssi_b[bssid]) for bssid, rssi in zip(a.bssids, a.rssi.tolist(), strict=True) if bssid in rssi_b]
    both = np.array(pairs, np.float64).reshape(-1, 2)
    strength = both.sum(axis=1)
    stronger = both[strength >= np.median(strength)] if len(both) else both
    difference_db: Floats = stronger[:, 0] - stronger[:, 1]
    return difference_db
