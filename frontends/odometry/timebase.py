"""The time base: makes stamps monotone. Single stamps that jump are dropped; a clock set back shifts the time base."""

from dataclasses import dataclass, field

from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import SECOND_NS

MIN_SHIFT_NS = SECOND_NS  # back: less is messages out of order, or a correction by NTP, and soon over
CONFIRMING_MESSAGES = 5  # in a row that confirm a jump: single broken stamps move nothing, and 0.5 s is lost at 10 Hz
LEAP_NS = 60 * SECOND_NS  # ahead: pauses are mostly shorter; a stamp beyond needs the next ones to confirm it
MAX_STAMP_NS = (2**31 - 365 * 86_400) * SECOND_NS  # a message's seconds are int32: leaves a year for shifts to go on


@dataclass(slots=True)
class _Stream:
    """The last accepted stamp of a stream, its interval to the one before, and the stamps since that jumped."""

    last_ns: int
    interval_ns: int = 0
    back: list[int] = field(default_factory=list)
    ahead: list[int] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Stamped:
    """A stamp on the time base, or why the message is `dropped`. `shift_ns` is by how much it moved the time base."""

    stamp_ns: int
    dropped: DropReason | None = None
    shift_ns: int = 0


class TimeBase:
    """One offset for all sensors, since they share the robot's clock; the order is checked for each stream by itself.

    A clock set forward looks like a gap in the data, and is treated as one. A stamp that the offset would take beyond
    MAX_STAMP_NS means that the clock was set back before and is right again: then the offset is reduced.
    """

    def __init__(self) -> None:
        self.offset_ns = 0
        self._streams: dict[str, _Stream] = {}

    def accept(self, stream: str, stamp_ns: int) -> Stamped:
        """The stamp on the time base of the next message of `stream`, whose own stamp is `stamp_ns`."""
        known = self._streams.get(stream)
        stamp_ns += self.offset_ns
        if known is None:
            return self._begin(stream, stamp_ns)
        if stamp_ns - known.last_ns > LEAP_NS:
            return self._jumped_ahead(known, stamp_ns)
        if stamp_ns > known.last_ns:
            return _follow(known, stamp_ns)
        if stamp_ns == known.last_ns:
            return Stamped(stamp_ns, DropReason.DUPLICATE)
        return self._jumped_back(known, stamp_ns)

    def _begin(self, stream: str, stamp_ns: int) -> Stamped:
        if stamp_ns > MAX_STAMP_NS:
            return Stamped(stamp_ns, DropReason.STAMP_AHEAD)
        self._streams[stream] = _Stream(stamp_ns)
        return Stamped(stamp_ns)

    def _jumped_ahead(self, stream: _Stream, stamp_ns: int) -> Stamped:
        if self._is_lone_leap(stream, stamp_ns):
            return Stamped(stamp_ns, DropReason.STAMP_AHEAD)
        if stamp_ns <= MAX_STAMP_NS:
            return _follow(stream, stamp_ns)
        next_ns = stream.last_ns + max(stream.interval_ns, 1) + stamp_ns - stream.ahead[0]
        stream.ahead.clear()
        reduced_by_ns = min(self.offset_ns, max(stamp_ns - next_ns, 0))
        if stamp_ns - reduced_by_ns > MAX_STAMP_NS:
            return Stamped(stamp_ns, DropReason.STAMP_AHEAD)
        self.offset_ns -= reduced_by_ns
        return _follow(stream, stamp_ns - reduced_by_ns, -reduced_by_ns)

    def _is_lone_leap(self, stream: _Stream, stamp_ns: int) -> bool:
        """Whether too few stamps in a row have been as far ahead as this one for a gap."""
        if stream.ahead and not 0 < stamp_ns - stream.ahead[-1] < LEAP_NS:
            stream.ahead.clear()
        stream.ahead.append(stamp_ns)
        return len(stream.ahead) < CONFIRMING_MESSAGES

    def _jumped_back(self, stream: _Stream, stamp_ns: int) -> Stamped:
        rising = not stream.back or 0 < stamp_ns - stream.back[-1] < LEAP_NS
        if stream.last_ns - stamp_ns <= MIN_SHIFT_NS or not rising:
            stream.back.clear()
            return Stamped(stamp_ns, DropReason.STAMP_BACK)
        stream.back.append(stamp_ns)
        if len(stream.back) < CONFIRMING_MESSAGES:
            return Stamped(stamp_ns, DropReason.STAMP_BACK)
        step = stream.back[-1] - stream.back[0]
        shift_ns = stream.last_ns + max(stream.interval_ns, 1) + step - stamp_ns
        self.offset_ns += shift_ns
        stream.last_ns = stamp_ns + shift_ns
        stream.back.clear()
        return Stamped(stamp_ns + shift_ns, shift_ns=shift_ns)


def _follow(stream: _Stream, stamp_ns: int, shift_ns: int = 0) -> Stamped:
    stream.ahead.clear()
    stream.back.clear()
    stream.interval_ns = min(stamp_ns - stream.last_ns, LEAP_NS)
    stream.last_ns = stamp_ns
    return Stamped(stamp_ns, shift_ns=shift_ns)
