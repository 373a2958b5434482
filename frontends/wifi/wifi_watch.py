"""Checks each WiFi receiver for faults that last, and drops the scans that they spoil.

A complaint rests on the latest scans or readings together, not on one scan: drivers cut their sweeps into scans as they
like, some into one for each channel.
"""

import math
from collections.abc import Generator, Iterator

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.complaints import Complaints, Fault
from wayfi.frontends.events import Dropped, DropReason, Event
from wayfi.frontends.measurements import SECOND_NS, Sensor, WifiScan
from wayfi.frontends.wifi.readings import BSSID, HIGHEST_DBM, LOWEST_DBM, Readings
from wayfi.frontends.wifi.wifi_config import WifiWatchConfig

KNOWN_BSSIDS = 1000  # remembered of a receiver, to bound memory: several places' worth, at 130 a place

Judgement = Generator[Event, None, bool]
"""Yields the complaints that begin or end, and the scan if it is dropped; returns whether the scan may be used."""


class WifiWatch:
    """Judges every receiver by itself, in bounded memory for each."""

    def __init__(self, config: WifiWatchConfig) -> None:
        self._config = config
        self._complaints = Complaints("WiFi receiver {!r}", faults(config), config.silent_s)
        self._heard: dict[str, _LastHeard] = {}

    def count(self, stamp_ns: int, receiver: str, readings: int) -> Judgement:
        """Judge a scan by its number of `readings`."""
        self._complaints.heard(receiver)
        too_many = readings > self._config.max_readings
        text = f"{readings} readings in one scan, more than are heard at a place; such scans are not used"
        yield from self._complaints.judge(stamp_ns, receiver, DropReason.TOO_MANY_READINGS, [too_many], text)
        return (yield from _use(stamp_ns, DropReason.TOO_MANY_READINGS if too_many else None))

    def compare_clocks(self, stamp_ns: int, receiver: str, ahead_ns: int) -> Judgement:
        """Judge a scan whose stamp is `ahead_ns` ahead of the odometry's (below zero: behind).

        A steady offset is not corrected: a slow clock and scans that come late look the same, but need opposite
        corrections.
        """
        off = abs(ahead_ns) > self._config.clock_s * SECOND_NS
        where = f"{abs(ahead_ns) / SECOND_NS:.1f} s {'ahead of' if ahead_ns > 0 else 'behind'}"
        text = f"its stamps are {where} the odometry's; its scans are not used (set its clock, or send them sooner)"
        lasts = yield from self._complaints.judge(stamp_ns, receiver, DropReason.CLOCK_OFF, [off], text)
        return (yield from _use(stamp_ns, DropReason.CLOCK_OFF if off or lasts else None))

    def check_readings(self, stamp_ns: int, scan: WifiScan) -> Judgement:
        """Judge how the readings of a scan are written: their BSSIDs, RSSI and ages."""
        judge = self._complaints.judge
        malformed = [not BSSID.fullmatch(bssid) for bssid in scan.bssids]
        absurd = ~((scan.rssi >= LOWEST_DBM) & (scan.rssi <= HIGHEST_DBM))
        aged = scan.age_s[(scan.age_s > 0.0) & (scan.age_s < np.inf)]
        bad = scan.bssids[malformed.index(True)] if any(malformed) else ""
        yield from judge(stamp_ns, scan.receiver, DropReason.MALFORMED_BSSID, malformed, _text_of_bssid(bad))
        no_dbm = yield from judge(
            stamp_ns, scan.receiver, DropReason.ABSURD_RSSI, absurd.tolist(), _text_of_rssi(scan.rssi[absurd])
        )
        old = yield from judge(
            stamp_ns, scan.receiver, DropReason.ABSURD_AGE, (aged > self._config.old_s).tolist(), _text_of_age(aged)
        )
        return (yield from _use(stamp_ns, DropReason.NO_READINGS if no_dbm else DropReason.ABSURD_AGE if old else None))

    def compare_rssi(self, stamp_ns: int, receiver: str, readings: Readings, taken_m: Floats) -> Judgement:
        """Judge the usable readings of a scan, taken at `taken_m` (n,) m of the path."""
        heard = self._heard.setdefault(receiver, _LastHeard(self._config.level_change_m))
        new, same = heard.compare(readings, taken_m)
        text = "it hears new BSSIDs in every scan, as if they were randomised; its scans are not used"
        randomised = yield from self._complaints.judge(stamp_ns, receiver, DropReason.RANDOMISED_BSSIDS, new, text)
        text = "its RSSI stays the same while the robot moves; its scans are not used (restart its driver)"
        constant = yield from self._complaints.judge(stamp_ns, receiver, DropReason.CONSTANT_LEVELS, same, text)
        reason = DropReason.RANDOMISED_BSSIDS if randomised else DropReason.CONSTANT_LEVELS if constant else None
        return (yield from _use(stamp_ns, reason))

    def pass_time(self, stamp_ns: int) -> Iterator[Event]:
        """Complain of receivers that have sent nothing for long when the odometry has come to `stamp_ns`."""
        return self._complaints.pass_time(stamp_ns)


class _LastHeard:
    """The RSSI (dBm) and the place (m of the path) at which one receiver last heard each BSSID."""

    def __init__(self, change_m: float) -> None:
        self._change_m = change_m
        self._last: dict[str, tuple[float, float]] = {}

    def compare(self, readings: Readings, taken_m: Floats) -> tuple[list[bool], list[bool]]:
        """Whether each BSSID is new; and for each last heard `change_m` before or more, whether its RSSI is the same.

        Of a receiver's first scan none counts as new.

        The RSSI and the place of a BSSID are replaced only once the robot has moved by `change_m`.
        """
        first, new, same = not self._last, [], []
        for bssid, rssi, path_m in zip(readings.bssids, readings.rssi.tolist(), taken_m.tolist(), strict=True):
            before = self._last.pop(bssid, None)
            new.append(before is None)
            moved = before is not None and path_m - before[1] >= self._change_m
            if before is not None and moved:
                same.append(rssi == before[0])
            kept = before is not None and not moved and not math.isnan(before[1])
            self._last[bssid] = before if before is not None and kept else (rssi, path_m)
        while len(self._last) > KNOWN_BSSIDS:
            del self._last[next(iter(self._last))]
        return [] if first else new, same


def faults(config: WifiWatchConfig) -> dict[str, Fault]:
    """The complaints that there can be about a receiver, other than silence."""
    scans = config.window_scans
    return {
        DropReason.TOO_MANY_READINGS: Fault(1, scans, "its scans are of a usual size again"),
        **{
            reason: Fault(config.faulty_readings, config.window_faulty, ends)
            for reason, ends in (
                (DropReason.MALFORMED_BSSID, "its BSSIDs are in a form that is known again"),
                (DropReason.ABSURD_RSSI, "its RSSI is in dBm again"),
                (DropReason.ABSURD_AGE, "the ages of its readings are possible again"),
            )
        },
        DropReason.CLOCK_OFF: Fault(config.clock_faults, scans, "its stamps agree with the odometry's again"),
        DropReason.RANDOMISED_BSSIDS: Fault(
            config.new_bssids, config.window_readings, "it hears the same BSSIDs again"
        ),
        DropReason.CONSTANT_LEVELS: Fault(config.constant_levels, config.window_levels, "its RSSI changes again"),
    }


def _text_of_bssid(bssid: str) -> str:
    return f"its BSSIDs are in a form that is not known, such as {bssid[:40]!r}; such readings are not used"


def _text_of_rssi(rssi: NDArray[np.float32]) -> str:
    """What is told of RSSI (n,) that is none in dBm."""
    finite = rssi[np.isfinite(rssi)]
    if len(finite) == 0:
        return "its RSSI is not a number; its scans are not used (send dBm)"
    what = "hundredths of dBm? its scans are not used (divide by 100)"
    if finite.max() > HIGHEST_DBM:
        what = "per cent, or dBm without their sign? its scans are not used (send dBm; of per cent about p / 2 - 100)"
    return f"its RSSI is {finite.min():g} to {finite.max():g}: {what}"


def _text_of_age(aged: NDArray[np.float32]) -> str:
    """What is told of the ages (n,) of readings, s."""
    oldest = float(aged.max(initial=0.0))
    return f"its readings have ages up to {oldest:g} s: are they in ms? its scans are not used (send seconds)"


def _use(stamp_ns: int, refused: DropReason | None) -> Judgement:
    if refused:
        yield Dropped(Sensor.WIFI, stamp_ns, refused)
    return refused is None
