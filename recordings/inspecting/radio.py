"""What a stream of WiFi scans holds, by the rules that the pipeline itself takes readings with."""

from array import array
from collections import Counter
from dataclasses import dataclass

import numpy as np

from wayfi.frontends.measurements import WifiScan
from wayfi.frontends.wifi.readings import usable_readings


@dataclass(frozen=True, slots=True)
class WifiInspection:
    """Scans by receiver; the median number of usable readings in a scan; levels (5th and 95th percentile), dBm.

    `dropped` counts the readings that cannot be used by their reason; `odd_bssid` is one in a form that is not known.
    """

    scans: dict[str, int]
    readings: float
    rssi_dbm: tuple[float, float] | None
    dropped: dict[str, int]
    odd_bssid: str | None


class Radio:
    """Gathers the scans of one stream."""

    def __init__(self) -> None:
        self._scans: Counter[str] = Counter()
        self._dropped: Counter[str] = Counter()
        self._counts = array("l")
        self._levels = array("f")
        self._odd: str | None = None

    def add(self, scan: WifiScan) -> None:
        """Add a scan."""
        readings, dropped = usable_readings(scan)
        self._scans[scan.receiver] += 1
        self._dropped.update(reason.value for reason in dropped)
        self._counts.append(len(readings.bssids))
        self._levels.extend(scan.rssi.tolist())
        if dropped and self._odd is None:
            self._odd = next((bssid for bssid in scan.bssids if bssid not in readings.bssids), None)

    def inspection(self) -> WifiInspection:
        """What the scans so far hold."""
        levels = np.array(self._levels, np.float64)
        levels = levels[np.isfinite(levels)]
        low, high = np.percentile(levels, [5, 95]).tolist() if len(levels) else (0.0, 0.0)
        return WifiInspection(
            scans=dict(sorted(self._scans.items())),
            readings=float(np.median(self._counts)) if self._counts else 0.0,
            rssi_dbm=(low, high) if len(levels) else None,
            dropped=dict(self._dropped.most_common()),
            odd_bssid=self._odd if "malformed_bssid" in self._dropped else None,
        )
