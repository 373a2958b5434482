"""What was heard at each place, from readings of all ages.

Phones report readings that are seconds old: one scan mixes places metres apart, and what was heard at one place comes
with several scans. So a reading counts where it was taken, and a scan becomes what was heard where it ended: the mean
of all readings taken within `NEAR_M` of there, as soon as most of them have come.
"""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.wifi.fingerprints import Readings

NEAR_M = 1.0  # to each side: a phone that reports an access point once a metre leaves holes in less
TOGETHER_S = 0.5  # ages that are below this, or unknown: the scan was taken where it ended
COME_QUANTILE = 0.9  # of the ages of a scan: so long it waits for later scans to tell of its place
KEEP_NS = 30 * SECOND_NS  # a robot that stands still gathers no more than this
MOST_KEPT = 500  # scans of a receiver: that long, channel by channel


@dataclass(frozen=True, slots=True, eq=False)
class PlacedReadings:
    """What `receiver` heard at a `point` of the path."""

    receiver: str
    point: PathPoint
    readings: Readings


@dataclass(frozen=True, slots=True, eq=False)
class _Scan:
    """Readings, taken at `taken_m` (n,) on the path, of a scan that ended at `point`; `due_ns` as the odometry goes."""

    point: PathPoint
    readings: Readings
    taken_m: Floats
    due_ns: int


@dataclass(frozen=True, slots=True)
class _Receiver:
    heard: deque[_Scan] = field(default_factory=lambda: deque(maxlen=MOST_KEPT))
    waiting: deque[_Scan] = field(default_factory=lambda: deque(maxlen=MOST_KEPT))


class ReadingsByPlace:
    """Gathers readings for each receiver by itself, over no more than a minute."""

    def __init__(self) -> None:
        self._receivers: dict[str, _Receiver] = {}

    def add(self, receiver: str, point: PathPoint, readings: Readings, taken_m: Floats) -> None:
        """A scan that ended at `point`; its readings were taken at `taken_m` (n,), NaN where that is not known."""
        known = self._receivers.setdefault(receiver, _Receiver())
        placed_s = readings.age_s[~np.isnan(taken_m)]
        wait_s = 0.0 if _is_whole(readings) or len(placed_s) == 0 else float(np.quantile(placed_s, COME_QUANTILE))
        scan = _Scan(point, readings, taken_m, point.stamp_ns + int(wait_s * SECOND_NS))
        known.heard.append(scan)
        known.waiting.append(scan)

    def ready(self, now_ns: int) -> list[PlacedReadings]:
        """What was heard at the places that are due, now that the odometry has come to `now_ns`."""
        out = []
        for receiver, known in self._receivers.items():
            while known.waiting and known.waiting[0].due_ns <= now_ns:
                scan = known.waiting.popleft()
                while known.heard[0].point.stamp_ns < scan.point.stamp_ns - KEEP_NS:
                    known.heard.popleft()
                readings = scan.readings if _is_whole(scan.readings) else _near(scan.point, known.heard)
                if readings.bssids:
                    out.append(PlacedReadings(receiver, scan.point, readings))
        return out


def _is_whole(readings: Readings) -> bool:
    return bool((readings.age_s <= TOGETHER_S).all())


def _near(point: PathPoint, scans: deque[_Scan]) -> Readings:
    """The mean level of each BSSID that was heard near `point`."""
    levels: dict[str, list[float]] = {}
    for scan in scans:
        for i in np.flatnonzero(np.abs(scan.taken_m - point.path_m) <= NEAR_M):
            levels.setdefault(scan.readings.bssids[i], []).append(float(scan.readings.rssi[i]))
    mean = np.array([np.mean(level) for level in levels.values()], np.float32)
    return Readings(tuple(levels), mean, np.zeros(len(mean), np.float32), ())
