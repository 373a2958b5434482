"""The readings of a WiFi scan: which are usable, and where on the path they were taken."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import WifiScan
from wayfi.frontends.odometry.driven_path import PathPoint

LOWEST_DBM, HIGHEST_DBM = -120.0, 0.0  # thermal noise in 20 MHz is -101 dBm; 1 m from 100 mW it is -20
BSSID = re.compile(r"[0-9a-f]{2}(:[0-9a-f]{2}){5}")
_OCTETS = re.compile(r"[0-9a-f]{1,2}(:[0-9a-f]{1,2}){5}|[0-9a-f]{1,2}(-[0-9a-f]{1,2}){5}")  # macOS drops leading zeros
_BARE = re.compile(r"[0-9a-f]{12}|[0-9a-f]{4}(\.[0-9a-f]{4}){2}|[0-9a-f]{6}[-:][0-9a-f]{6}")  # Cisco's dots, HP's dash


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """One reading for each of `bssids`: `rssi` (n,) dBm, and `age_s` (n,) before the scan's end (0: unknown)."""

    bssids: tuple[str, ...]
    rssi: NDArray[np.float32]
    age_s: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class PlacedWifiScan:
    """A scan that `receiver` took at `point` of the path, where it ended if its readings are of several places.

    They were taken at `taken_m` (n,) of the path, NaN where that is no longer kept.
    """

    receiver: str
    point: PathPoint
    readings: Readings
    taken_m: Floats


def bssid_of(text: str) -> str:
    """The BSSID in `text` as lower-case colon hex; a form that is not known stays as it is, without blanks around."""
    text = text.strip(" \t\r\n\0").lower()
    if BSSID.fullmatch(text):
        return text
    if _OCTETS.fullmatch(text):
        return ":".join(octet.zfill(2) for octet in text.replace("-", ":").split(":"))
    if _BARE.fullmatch(text):
        digits = re.sub("[-:.]", "", text)
        return ":".join(digits[i : i + 2] for i in range(0, 12, 2))
    return text


def usable_readings(scan: WifiScan) -> tuple[Readings, list[DropReason]]:
    """The readings with a well-formed BSSID and a possible RSSI, and why each other one is dropped.

    Of a repeated BSSID the strongest reading stays. An age that is negative or not finite counts as unknown.
    """
    usable: dict[str, tuple[float, float]] = {}
    dropped = []
    for bssid, rssi, age in zip(scan.bssids, scan.rssi.tolist(), scan.age_s.tolist(), strict=True):
        if not BSSID.fullmatch(bssid):
            dropped.append(DropReason.MALFORMED_BSSID)
        elif not LOWEST_DBM <= rssi <= HIGHEST_DBM:
            dropped.append(DropReason.ABSURD_RSSI)
        elif bssid not in usable or rssi > usable[bssid][0]:
            usable[bssid] = (rssi, age if 0.0 <= age < math.inf else 0.0)
    rssi_age = np.array(list(usable.values()), np.float32).reshape(-1, 2)
    return Readings(tuple(usable), rssi_age[:, 0], rssi_age[:, 1]), dropped


def mean_readings(scans: list[Readings], least_scans: float) -> Readings:
    """The mean RSSI of each BSSID that was heard in `least_scans` or more of the scans, of unknown age."""
    heard: dict[str, list[float]] = {}
    for readings in scans:
        for bssid, rssi in zip(readings.bssids, readings.rssi.tolist(), strict=True):
            heard.setdefault(bssid, []).append(rssi)
    return mean_rssi({bssid: rssi for bssid, rssi in heard.items() if len(rssi) >= least_scans})


def mean_rssi(heard: Mapping[str, Sequence[float]]) -> Readings:
    """One reading for each BSSID, the mean of what was heard of it (dBm, once or more), of unknown age."""
    mean = np.array([sum(rssi) / len(rssi) for rssi in heard.values()], np.float32)
    return Readings(tuple(heard), mean, np.zeros(len(mean), np.float32))
