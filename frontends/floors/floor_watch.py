"""Notices that the robot may have changed floors: WiFi has changed while the laser saw a cabin; without one, never."""

import math
from collections.abc import Iterable

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.floors.floor_config import FloorConfig
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.wifi.readings import Readings


class FloorWatch:
    """Watches the laser and WiFi along the path.

    From the cabin on it is `doubtful` which floor the robot is on, until a scan of WiFi tells that was taken outside.
    """

    def __init__(self, config: FloorConfig, sigma_db: float) -> None:
        self._config, self._sigma_db = config, sigma_db
        self._usual: float | None = None
        self._last: dict[str, tuple[float, Readings]] = {}
        self._cabin_m = -math.inf
        self.left_m: float | None = None  # the path up to where the robot may have left its floor

    @property
    def doubtful(self) -> bool:
        """Whether it is not known which floor the robot is on."""
        return self.left_m is not None

    def see(self, scan: ScanPoints, path_m: float) -> None:
        """Take note of a scan of the laser at `path_m` (m) of the path."""
        if is_cabin(scan, self._config):
            self._cabin_m = path_m

    def leave(self, path_m: float) -> None:
        """The robot may be leaving its floor, at `path_m` (m) of the path."""
        self.left_m = path_m

    def settle(self) -> None:
        """The floor is known again."""
        self.left_m = None

    def drive(self, path_m: float) -> None:
        """The path has come to `path_m` (m): where WiFi has been silent for long, the floor is taken to be the same."""
        if self.left_m is not None and path_m - self.left_m > self._config.silent_m:
            self.left_m = None

    def hear(self, receiver: str, path_m: float, readings: Readings) -> bool:
        """Take note of a WiFi scan; returns whether it is to tell the floor, with `floor_of`."""
        last_m, last = self._last.get(receiver, (-math.inf, readings))
        self._last[receiver] = (path_m, readings)
        if self.left_m is not None:
            return path_m - self.left_m >= self._config.leaving_m
        if path_m - last_m <= self._config.still_m:
            alike = similarity(last, readings, self._sigma_db)
            usual = alike if self._usual is None else self._usual
            in_cabin = path_m - self._cabin_m <= self._config.still_m
            if in_cabin and alike < self._config.changed * usual:
                self.left_m = path_m
            else:
                self._usual = self._config.memory * usual + (1 - self._config.memory) * alike
        return False

    def floor_of(self, readings: Readings, near: Iterable[tuple[int, Readings]], present: int, newest: int) -> int:
        """The floor on which a scan was taken, by the fingerprints near with their floors; doubt ends with it.

        That is the one of the most similar fingerprint, if it is similar enough; else a new one, after the `newest`.
        Without scans of one place to know the usual similarity from it is the `present` one.
        """
        self.left_m = None
        if self._usual is None:
            return present
        best, floor = 0.0, present
        for at, fingerprint in near:
            alike = similarity(readings, fingerprint, self._sigma_db)
            if alike > best:
                best, floor = alike, at
        return floor if best >= self._config.same * self._usual else newest + 1


def is_cabin(scan: ScanPoints, config: FloorConfig) -> bool:
    """Whether a scan sees no more than a cabin around the robot."""
    if len(scan.points) < config.cabin_points:
        return False
    sensor = scan.T_base_laser
    ranges: Floats = np.hypot(scan.points[:, 0] - sensor.x, scan.points[:, 1] - sensor.y)
    return bool(np.quantile(ranges, 0.9) < config.cabin_m)


def similarity(one: Readings, other: Readings, sigma_db: float) -> float:
    """The similarity of two scans of one receiver, 0 to 1, with all access points alike (see fingerprint_index)."""
    levels = dict(zip(other.bssids, other.rssi.tolist(), strict=True))
    common = [(rssi, levels[b]) for b, rssi in zip(one.bssids, one.rssi.tolist(), strict=True) if b in levels]
    heard = len(one.bssids) + len(other.bssids) - len(common)
    agreement = sum(math.exp(-0.5 * ((a - b) / sigma_db) ** 2) for a, b in common)
    return agreement / heard if heard else 0.0
