"""Gathers readings of all ages where on the path they were taken.

Phones report readings that are seconds old: one scan mixes places metres apart, and the readings of one place come with
several scans. So a reading counts where it was taken, and such a scan is replaced by what was heard where it ended: the
mean of all readings taken within `near_m` of there. It waits until most of these have come. A scan whose readings are
all about as old is used as it is, where they were taken.
"""

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np

from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.wifi.readings import PlacedWifiScan, Readings, mean_rssi
from wayfi.frontends.wifi.wifi_config import ByPlaceConfig

KEPT_NS = 30 * SECOND_NS  # before a scan: bounds what a robot that stands still gathers
MOST_KEPT = 500  # scans of a receiver, to bound memory: 30 s of a driver that sends each channel by itself


@dataclass(slots=True)
class _Receiver:
    """The recent scans of a receiver, each with the stamp (ns) at which it is due; the last `waiting` are not yet."""

    recent: deque[tuple[PlacedWifiScan, int]] = field(default_factory=lambda: deque(maxlen=MOST_KEPT))
    waiting: int = 0


class ReadingsByPlace:
    """Gathers readings for each receiver by itself, over no more than a minute."""

    def __init__(self, config: ByPlaceConfig) -> None:
        self._config = config
        self._receivers: dict[str, _Receiver] = {}

    def add(self, scan: PlacedWifiScan) -> None:
        """Add the next scan of its receiver."""
        known = self._receivers.setdefault(scan.receiver, _Receiver())
        known.recent.append((scan, scan.point.stamp_ns + self._wait_ns(scan)))
        known.waiting = min(known.waiting + 1, MOST_KEPT)

    def common_age_s(self, readings: Readings) -> float | None:
        """How old (s) all readings of a scan are, if they were taken together."""
        oldest_s, newest_s = float(readings.age_s.max()), float(readings.age_s.min())
        return 0.5 * (oldest_s + newest_s) if oldest_s - newest_s <= self._config.together_s else None

    def ready(self, now_ns: int) -> list[PlacedWifiScan]:
        """The scans that are due now that the odometry has come to `now_ns`, each with what was heard at its place."""
        return [scan for known in self._receivers.values() for scan in self._due(known, now_ns)]

    def _due(self, known: _Receiver, now_ns: int) -> list[PlacedWifiScan]:
        due = []
        while known.waiting and known.recent[-known.waiting][1] <= now_ns:
            scan, _ = known.recent[-known.waiting]
            known.waiting -= 1
            while known.recent[0][0].point.stamp_ns < scan.point.stamp_ns - KEPT_NS:
                known.recent.popleft()
            together = self.common_age_s(scan.readings) is not None
            readings = scan.readings if together else self._near(scan.point, known.recent)
            if readings.bssids:
                due.append(replace(scan, readings=readings))
        return due

    def _wait_ns(self, scan: PlacedWifiScan) -> int:
        """How long to wait for later scans with readings from where this one ended."""
        placed_s = scan.readings.age_s[~np.isnan(scan.taken_m)]
        if self.common_age_s(scan.readings) is not None or len(placed_s) == 0:
            return 0
        return int(float(np.quantile(placed_s, self._config.wait_quantile)) * SECOND_NS)

    def _near(self, point: PathPoint, scans: deque[tuple[PlacedWifiScan, int]]) -> Readings:
        """The mean RSSI of each BSSID that was heard near `point`."""
        heard: dict[str, list[float]] = {}
        for scan, _ in scans:
            near = np.flatnonzero(np.abs(scan.taken_m - point.path_m) <= self._config.near_m)
            for i, rssi in zip(near.tolist(), scan.readings.rssi[near].tolist(), strict=True):
                heard.setdefault(scan.readings.bssids[i], []).append(rssi)
        return mean_rssi(heard)
