"""How many dB each receiver reads above the first: two phones on a robot hear the same access point differently.

Fingerprints of two receivers from one place of the path differ by their receivers' offsets, and by fading. The median
over the common access points measures the difference of the offsets; a Kalman filter fuses such measurements. Only the
stronger half of the access points counts: a receiver reports a weak one only where fading has lifted it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.wifi.readings import Readings
from wayfi.frontends.wifi.wifi_config import ReceiversConfig


@dataclass(frozen=True, slots=True)
class ReceiverOffset:
    """How many dB a receiver reads above the reference, which has offset and sigma 0."""

    offset_db: float
    sigma_db: float


class Receivers:
    """The offsets of the receivers; the first that is heard is the reference, unless some are `known` already."""

    def __init__(self, config: ReceiversConfig, known: Mapping[str, ReceiverOffset]) -> None:
        self._config = config
        self._number = {receiver: number for number, receiver in enumerate(known)}
        self._offset_db: Floats = np.array([offset.offset_db for offset in known.values()])
        self._covariance: Floats = np.diag([offset.sigma_db**2 for offset in known.values()])
        self._latest: dict[str, tuple[float, Readings]] = {}
        self._compared_m: dict[frozenset[str], float] = {}
        self._path_m = math.inf

    @property
    def offsets(self) -> dict[str, ReceiverOffset]:
        """The estimated offset of each receiver."""
        sigma_db = np.sqrt(np.diag(self._covariance))
        return {r: ReceiverOffset(float(self._offset_db[n]), float(sigma_db[n])) for r, n in self._number.items()}

    def learn(self, receiver: str, path_m: float, readings: Readings) -> None:
        """Update the offsets by what `receiver` heard at `path_m` (m) of the path, not corrected."""
        self._walk(path_m)
        self._introduce(receiver)
        for other, (other_m, other_readings) in self._latest.items():
            pair = frozenset((receiver, other))
            compared_m = self._compared_m.get(pair, -math.inf)
            if other != receiver and abs(path_m - other_m) <= self._config.one_place_m <= path_m - compared_m:
                difference_db = stronger_differences(readings, other_readings)
                if len(difference_db) >= self._config.min_common:
                    self._compared_m[pair] = path_m
                    self._measure(self._number[receiver], self._number[other], difference_db)
        self._latest[receiver] = (path_m, readings)

    def corrected(self, receiver: str, readings: Readings) -> Readings:
        """`readings` of `receiver`, less its estimated offset from the reference."""
        self._introduce(receiver)
        return replace(readings, rssi=readings.rssi - np.float32(self._offset_db[self._number[receiver]]))

    def _introduce(self, receiver: str) -> None:
        if receiver in self._number:
            return
        others = len(self._number)
        covariance = np.zeros((others + 1, others + 1))
        covariance[:others, :others] = self._covariance.reshape(others, others)
        covariance[others, others] = self._config.prior_sigma_db**2 if others else 0.0
        self._number[receiver] = others
        self._offset_db, self._covariance = np.append(self._offset_db, 0.0), covariance

    def _walk(self, path_m: float) -> None:
        """Predict: the variance of every offset but the reference's grows with the path (m) driven since."""
        moved_m = max(0.0, path_m - self._path_m)
        self._path_m = path_m if math.isinf(self._path_m) else max(self._path_m, path_m)
        changing = np.diag(self._covariance) > 0.0
        self._covariance += np.diag(np.where(changing, self._config.walk_db_per_sqrt_m**2 * moved_m, 0.0))

    def _measure(self, a: int, b: int, difference_db: Floats) -> None:
        """Update by the (n,) dB that receiver `a` reads above `b`; pi sigma^2 / 2 n is the variance of a median."""
        row = np.zeros(len(self._offset_db))
        row[[a, b]] = 1.0, -1.0
        variance = math.pi / 2 * self._config.fading_db**2 / len(difference_db)
        innovation = float(np.median(difference_db)) - row @ self._offset_db
        gain = self._covariance @ row / (row @ self._covariance @ row + variance)
        self._offset_db = self._offset_db + gain * innovation
        self._covariance = self._covariance - np.outer(gain, row @ self._covariance)


def stronger_differences(a: Readings, b: Readings) -> Floats:
    """(n,) dB that `a` reads above `b`, of the stronger half of the access points that both heard."""
    rssi_b = dict(zip(b.bssids, b.rssi.tolist(), strict=True))
    pairs = [(rssi, rssi_b[bssid]) for bssid, rssi in zip(a.bssids, a.rssi.tolist(), strict=True) if bssid in rssi_b]
    both = np.array(pairs, np.float64).reshape(-1, 2)
    strength = both.sum(axis=1)
    stronger = both[strength >= np.median(strength)] if len(both) else both
    difference_db: Floats = stronger[:, 0] - stronger[:, 1]
    return difference_db
