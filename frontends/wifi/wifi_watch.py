"""A watch over each WiFi receiver: what is wrong with what it sends is told once when it begins, once when it ends.

A complaint rests on the last scans or readings taken together, not on one scan: drivers cut their sweeps into scans as
they like, some into one for each channel.
"""

import math
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, field

from wayfi.backend.pose2 import Floats
from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.measurements import SECOND_NS, Sensor
from wayfi.frontends.wifi.readings import Readings

MOST_READINGS = 256  # real receivers were seen to hear 130
CLOCK_NS = 2 * SECOND_NS  # a metre at walking robots' half a metre per second: closures are to be good to 1.5 m
CHANGE_M = 0.5  # of path, over which nine of ten levels were seen to change
KNOWN_BSSIDS = 1000  # that are remembered of a receiver: several places' worth
SILENT_S = 60  # a phone may be kept to a scan every half minute
GAP_NS = SECOND_NS
SILENT = "silent"

WINDOWS = {  # this many faulty ones among the last so many are a complaint
    DropReason.TOO_MANY_READINGS: (1, 20),  # scans
    DropReason.CLOCK_OFF: (5, 20),  # scans: single ones come late, and odometry with gaps lets some wrong stamps pass
    DropReason.RANDOMISED_BSSIDS: (230, 256),  # readings of new BSSIDs: real receivers were seen to have 145
    DropReason.CONSTANT_LEVELS: (18, 20),  # levels that stay as they were: real receivers were seen to repeat 9
}
_ENDS = {
    DropReason.TOO_MANY_READINGS: "its scans are of a usual size again",
    DropReason.CLOCK_OFF: "its stamps agree with the odometry's again",
    DropReason.RANDOMISED_BSSIDS: "it hears the same BSSIDs again",
    DropReason.CONSTANT_LEVELS: "its levels change again",
    SILENT: "scans come again",
}

Judgement = Generator[Event, None, bool]
"""Yields the complaints that begin or end, and the scan if it is dropped; returns whether the scan may be used."""


class WifiWatch:
    """Watches every receiver by itself, in bounded memory for each."""

    def __init__(self) -> None:
        self._receivers: dict[str, _Receiver] = {}
        self._now_ns: int | None = None

    def count(self, stamp_ns: int, receiver: str, readings: int) -> Judgement:
        """A scan of so many `readings` has come."""
        known = self._receivers.setdefault(receiver, _Receiver(receiver))
        known.silent_ns = 0
        many = readings > MOST_READINGS
        text = f"{readings} readings in one scan, more than are heard at a place; such scans are not used"
        yield from known.judge(stamp_ns, DropReason.TOO_MANY_READINGS, [many], text)
        return (yield from _use(stamp_ns, DropReason.TOO_MANY_READINGS if many else None))

    def compare_clocks(self, stamp_ns: int, receiver: str, ahead_ns: int) -> Judgement:
        """The stamp of a scan is `ahead_ns` ahead of the odometry's (below zero: behind).

        A steady offset is not corrected: a clock that is slow and scans that come late look the same, and to correct
        the one would spoil the other.
        """
        known = self._receivers[receiver]
        off = abs(ahead_ns) > CLOCK_NS
        where = f"{abs(ahead_ns) / SECOND_NS:.1f} s {'ahead of' if ahead_ns > 0 else 'behind'}"
        text = f"its stamps are {where} the odometry's; its scans are not used (set its clock, or send them sooner)"
        lasts = yield from known.judge(stamp_ns, DropReason.CLOCK_OFF, [off], text)
        return (yield from _use(stamp_ns, DropReason.CLOCK_OFF if off or lasts else None))

    def hear(self, stamp_ns: int, receiver: str, readings: Readings, taken_m: Floats) -> Judgement:
        """The usable readings of a scan, taken at `taken_m` (n,) on the path."""
        known = self._receivers[receiver]
        new, same = known.compare(readings, taken_m)
        text = "it hears new BSSIDs in every scan, as if they were randomised; its scans are not used"
        strange = yield from known.judge(stamp_ns, DropReason.RANDOMISED_BSSIDS, new, text)
        text = "its levels stay the same while the robot moves; its scans are not used (restart its driver)"
        stuck = yield from known.judge(stamp_ns, DropReason.CONSTANT_LEVELS, same, text)
        reason = DropReason.RANDOMISED_BSSIDS if strange else DropReason.CONSTANT_LEVELS if stuck else None
        return (yield from _use(stamp_ns, reason))

    def pass_time(self, stamp_ns: int) -> Iterator[Event]:
        """The odometry has come to `stamp_ns`: who has sent nothing for long? Gaps of its own count for a second."""
        step_ns = 0 if self._now_ns is None else min(stamp_ns - self._now_ns, GAP_NS)
        self._now_ns = stamp_ns
        for known in self._receivers.values():
            known.silent_ns += step_ns
            yield from known.tell(stamp_ns, SILENT, known.silent_ns > SILENT_S * SECOND_NS, f"no scan for {SILENT_S} s")


@dataclass(slots=True)
class _Receiver:
    """What is remembered of one receiver: level and place of each BSSID, recent faults, the complaints that last."""

    name: str
    silent_ns: int = 0
    levels: dict[str, tuple[float, float]] = field(default_factory=dict)
    recent: dict[str, deque[bool]] = field(
        default_factory=lambda: {f: deque(maxlen=n) for f, (_, n) in WINDOWS.items()}
    )
    complaints: set[str] = field(default_factory=set)

    def compare(self, readings: Readings, taken_m: Floats) -> tuple[list[bool], list[bool]]:
        """Whether each BSSID is new; and, of each last heard some way before, whether its level is as it was there."""
        new, same = [], []
        for bssid, rssi, path_m in zip(readings.bssids, readings.rssi.tolist(), taken_m.tolist(), strict=True):
            before = self.levels.pop(bssid, None)
            new.append(before is None)
            moved = before is not None and path_m - before[1] >= CHANGE_M
            if before is not None and moved:
                same.append(rssi == before[0])
            kept = before is not None and not moved and not math.isnan(before[1])
            self.levels[bssid] = before if before is not None and kept else (rssi, path_m)
        while len(self.levels) > KNOWN_BSSIDS:
            del self.levels[next(iter(self.levels))]
        return new, same

    def judge(
        self, stamp_ns: int, fault: DropReason, faulty: Iterable[bool], text: str
    ) -> Generator[Warned, None, bool]:
        """Count what is faulty; returns whether there is a complaint now, which begins with `text`."""
        recent = self.recent[fault]
        recent.extend(faulty)
        lasts = sum(recent) >= WINDOWS[fault][0]
        yield from self.tell(stamp_ns, fault, lasts, text)
        return lasts

    def tell(self, stamp_ns: int, fault: str, lasts: bool, text: str) -> Iterator[Warned]:
        """Say where a complaint begins, with `text`, or ends."""
        if lasts == (fault in self.complaints):
            return
        self.complaints ^= {fault}
        said = f"WiFi receiver {self.name!r}: {text if lasts else _ENDS[fault]}"
        yield Warned(stamp_ns, said, f"{self.name}.{fault}", ends=not lasts)


def _use(stamp_ns: int, refused: DropReason | None) -> Judgement:
    if refused:
        yield Dropped(Sensor.WIFI, stamp_ns, refused)
    return refused is None
