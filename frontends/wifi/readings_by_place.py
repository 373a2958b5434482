"""What was heard at each place, from readings of all ages.

Phones report readings that are seconds old: one scan mixes places metres apart, and what was heard at one place comes
with several scans. So a reading counts where it was taken, and a scan becomes what was heard where it ended: the mean
of all readings taken within `NEAR_M` of there, as soon as most of them have come.
"""

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np

from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.wifi.readings import PlacedWifiScan, Readings

NEAR_M = 1.0  # to each side: a phone that reports an access point once a metre leaves holes in less
TOGETHER_S = 0.5  # ages that are below this, or unknown: the scan was taken where it ended
COME_QUANTILE = 0.9  # of the ages of a scan: so long it waits for later scans to tell of its place
KEEP_NS = 30 * SECOND_NS  # a robot that stands still gathers no more than this
MOST_KEPT = 500  # scans of a receiver: that long, channel by channel


@dataclass(slots=True)
class _Receiver:
    """The recent scans of a receiver, each with the time at which it is due; the last `waiting` are not due yet."""

    recent: deque[tuple[PlacedWifiScan, int]] = field(default_factory=lambda: deque(maxlen=MOST_KEPT))
    waiting: int = 0


class ReadingsByPlace:
    """Gathers readings for each receiver by itself, over no more than a minute."""

    def __init__(self) -> None:
        self._receivers: dict[str, _Receiver] = {}

    def add(self, scan: PlacedWifiScan) -> None:
        """Add the next scan of its receiver."""
        known = self._receivers.setdefault(scan.receiver, _Receiver())
        known.recent.append((scan, scan.point.stamp_ns + _wait_ns(scan)))
        known.waiting = min(known.waiting + 1, MOST_KEPT)

    def ready(self, now_ns: int) -> list[PlacedWifiScan]:
        """The scans that are due now that the odometry has come to `now_ns`, each with what was heard at its place."""
        return [scan for known in self._receivers.values() for scan in _due(known, now_ns)]


def _due(known: _Receiver, now_ns: int) -> list[PlacedWifiScan]:
    due = []
    while known.waiting and known.recent[-known.waiting][1] <= now_ns:
        scan, _ = known.recent[-known.waiting]
        known.waiting -= 1
        while known.recent[0][0].point.stamp_ns < scan.point.stamp_ns - KEEP_NS:
            known.recent.popleft()
        readings = scan.readings if _is_whole(scan.readings) else _near(scan.point, known.recent)
        if readings.bssids:
            due.append(replace(scan, readings=readings))
    return due


def _wait_ns(scan: PlacedWifiScan) -> int:
    """How long later scans may still tell of the place of this one."""
    placed_s = scan.readings.age_s[~np.isnan(scan.taken_m)]
    if _is_whole(scan.readings) or len(placed_s) == 0:
        return 0
    return int(float(np.quantile(placed_s, COME_QUANTILE)) * SECOND_NS)


def _is_whole(readings: Readings) -> bool:
    return bool((readings.age_s <= TOGETHER_S).all())


def _near(point: PathPoint, scans: deque[tuple[PlacedWifiScan, int]]) -> Readings:
    """The mean level of each BSSID that was heard near `point`."""
    levels: dict[str, list[float]] = {}
    for scan, _ in scans:
        for i in np.flatnonzero(np.abs(scan.taken_m - point.path_m) <= NEAR_M):
            levels.setdefault(scan.readings.bssids[i], []).append(float(scan.readings.rssi[i]))
    mean = np.array([np.mean(level) for level in levels.values()], np.float32)
    return Readings(tuple(levels), mean, np.zeros(len(mean), np.float32))
