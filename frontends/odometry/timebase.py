"""Makes stamps monotone: drops single stamps that jump, and shifts the time base where a clock was set back."""

from dataclasses import dataclass, field

from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.odometry_config import ClockConfig

LAST_LEAP_NS = (2**31 - 365 * 86_400) * SECOND_NS  # ROS 2 stamps end at 2^31 s: a leap ends a year before, to drive on


@dataclass(slots=True)
class _Stream:
    last_ns: int
    interval_ns: int = 0
    back: list[int] = field(default_factory=list)
    ahead: list[int] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Stamped:
    """A stamp on the time base (ns), or why the message is dropped; `shift_ns` is set when the time base was moved."""

    stamp_ns: int
    dropped: DropReason | None = None
    shift_ns: int = 0


class TimeBase:
    """One offset for all sensors, since they share the robot's clock; order is kept for each stream by itself.

    A clock set forward looks like a gap in the data, and is treated as one. Only where stamps would pass
    `LAST_LEAP_NS` is the offset of an earlier shift reduced: the clock is right again after it was set back.
    """

    def __init__(self, config: ClockConfig) -> None:
        self._lasting_jump_ns = round(config.lasting_jump_s * SECOND_NS)
        self._lasting_messages = config.lasting_messages
        self._leap_ns = round(config.leap_s * SECOND_NS)
        self.offset_ns = 0
        self._streams: dict[str, _Stream] = {}

    def accept(self, stream: str, stamp_ns: int) -> Stamped:
        """The stamp of the next message of `stream` on the time base, or why it is dropped."""
        known = self._streams.get(stream)
        stamp_ns += self.offset_ns
        if known is None:
            return self._begin(stream, stamp_ns)
        if stamp_ns - known.last_ns > self._leap_ns:
            return self._leapt_ahead(known, stamp_ns)
        if stamp_ns > known.last_ns:
            return self._follow(known, stamp_ns)
        if stamp_ns == known.last_ns:
            return Stamped(stamp_ns, DropReason.DUPLICATE)
        return self._jumped_back(known, stamp_ns)

    def _begin(self, stream: str, stamp_ns: int) -> Stamped:
        if stamp_ns > LAST_LEAP_NS:
            return Stamped(stamp_ns, DropReason.STAMP_AHEAD)
        self._streams[stream] = _Stream(stamp_ns)
        return Stamped(stamp_ns)

    def _leapt_ahead(self, stream: _Stream, stamp_ns: int) -> Stamped:
        if self._is_lone_leap(stream, stamp_ns):
            return Stamped(stamp_ns, DropReason.STAMP_AHEAD)
        if stamp_ns <= LAST_LEAP_NS:
            return self._follow(stream, stamp_ns)
        next_ns = stream.last_ns + max(stream.interval_ns, 1) + stamp_ns - stream.ahead[0]
        stream.ahead.clear()
        reduced_ns = min(self.offset_ns, max(stamp_ns - next_ns, 0))
        if stamp_ns - reduced_ns > LAST_LEAP_NS:
            return Stamped(stamp_ns, DropReason.STAMP_AHEAD)
        self.offset_ns -= reduced_ns
        return self._follow(stream, stamp_ns - reduced_ns, -reduced_ns)

    def _is_lone_leap(self, stream: _Stream, stamp_ns: int) -> bool:
        """Whether a stamp far ahead is a broken one: fewer than `lasting_messages` in a row are; as many are a gap."""
        if stream.ahead and not 0 < stamp_ns - stream.ahead[-1] < self._leap_ns:
            stream.ahead.clear()
        stream.ahead.append(stamp_ns)
        return len(stream.ahead) < self._lasting_messages

    def _jumped_back(self, stream: _Stream, stamp_ns: int) -> Stamped:
        rising = not stream.back or 0 < stamp_ns - stream.back[-1] < self._leap_ns
        if stream.last_ns - stamp_ns <= self._lasting_jump_ns or not rising:
            stream.back.clear()
            return Stamped(stamp_ns, DropReason.STAMP_BACK)
        stream.back.append(stamp_ns)
        if len(stream.back) < self._lasting_messages:
            return Stamped(stamp_ns, DropReason.STAMP_BACK)
        step = stream.back[-1] - stream.back[0]
        shift_ns = stream.last_ns + max(stream.interval_ns, 1) + step - stamp_ns
        self.offset_ns += shift_ns
        stream.last_ns = stamp_ns + shift_ns
        stream.back.clear()
        return Stamped(stamp_ns + shift_ns, shift_ns=shift_ns)

    def _follow(self, stream: _Stream, stamp_ns: int, shift_ns: int = 0) -> Stamped:
        stream.ahead.clear()
        stream.back.clear()
        stream.interval_ns = min(stamp_ns - stream.last_ns, self._leap_ns)
        stream.last_ns = stamp_ns
        return Stamped(stamp_ns, shift_ns=shift_ns)
