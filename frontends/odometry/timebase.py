"""Makes the stamps of one clock monotone: drops single jumps, and shifts the stamps where the clock was set back."""

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.odometry_config import ClockConfig

LAST_LEAP_NS = (2**31 - 365 * 86_400) * SECOND_NS  # ROS 2 stamps end at 2^31 s: a leap ends a year before, to drive on


class Stamped(NamedTuple):
    """A stamp on the time base (ns), or why the message is dropped; `shift_ns` is set where the offset was changed.

    `told` is what is to be told of the sensor's clock, if anything is.
    """

    stamp_ns: int
    dropped: DropReason | None = None
    shift_ns: int = 0
    told: str = ""


@dataclass(slots=True)
class _Stream:
    newest_ns: int
    interval_ns: int = 0
    back: list[int] = field(default_factory=list)
    ahead: list[int] = field(default_factory=list)


class TimeBase:
    """The offset of one clock's stamps; that of the odometry's is the time base of the drive.

    Several streams may be stamped by the clock; order is kept for each by itself. A clock set forward looks like a gap
    in the data, and is treated as one. Only where stamps would pass `LAST_LEAP_NS` is the offset of an earlier shift
    reduced: the clock is right again after it was set back.

    `newest_ns` is the stamp that was accepted last, None before the first; `interval_ns` its distance to the one before
    in its stream; `jumps` counts the shifts, and the steps ahead by more than a lasting jump. `wide_steps` are
    the newest of these steps, each from one stamp to the next.
    """

    def __init__(self, config: ClockConfig) -> None:
        self._lasting_jump_ns = round(config.lasting_jump_s * SECOND_NS)
        self._lasting_messages = config.lasting_messages
        self._leap_ns = round(config.leap_s * SECOND_NS)
        self._streams: dict[str, _Stream] = {}
        self.offset_ns = 0
        self.newest_ns: int | None = None
        self.interval_ns = 0
        self.jumps = 0
        self.wide_steps: deque[tuple[int, int]] = deque(maxlen=config.lasting_messages)

    def accept(self, stamp_ns: int, stream: str = "") -> Stamped:
        """The stamp of the next message of `stream` on the time base, or why it is dropped."""
        known = self._streams.get(stream)
        stamp_ns += self.offset_ns
        if known is None:
            return self._begin(stream, stamp_ns)
        if stamp_ns - known.newest_ns > self._leap_ns:
            return self._leapt_ahead(known, stamp_ns)
        if stamp_ns > known.newest_ns:
            return self._follow(known, stamp_ns)
        if stamp_ns == known.newest_ns:
            return Stamped(stamp_ns, DropReason.DUPLICATE)
        return self._jumped_back(known, stamp_ns)

    def shift(self, shift_ns: int, newest_ns: int | None) -> None:
        """Add `shift_ns` to the offset, and go on from `newest_ns`; None: from nothing yet."""
        self.offset_ns += shift_ns
        self.newest_ns = newest_ns
        self.jumps += 1
        if newest_ns is not None:
            self._streams = {stream: _Stream(newest_ns, known.interval_ns) for stream, known in self._streams.items()}

    def _begin(self, stream: str, stamp_ns: int) -> Stamped:
        if stamp_ns > LAST_LEAP_NS:
            return Stamped(stamp_ns, DropReason.STAMP_AHEAD)
        self._streams[stream] = _Stream(stamp_ns)
        self.newest_ns = stamp_ns
        return Stamped(stamp_ns)

    def _leapt_ahead(self, stream: _Stream, stamp_ns: int) -> Stamped:
        if self._is_lone_leap(stream, stamp_ns):
            return Stamped(stamp_ns, DropReason.STAMP_AHEAD)
        if stamp_ns <= LAST_LEAP_NS:
            return self._follow(stream, stamp_ns)
        next_ns = stream.newest_ns + max(stream.interval_ns, 1) + stamp_ns - stream.ahead[0]
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
        begins = not stream.back and stream.newest_ns - stamp_ns > self._lasting_jump_ns
        goes_on = stream.back and 0 < stamp_ns - stream.back[-1] < self._leap_ns
        if not (begins or goes_on):
            stream.back.clear()
            return Stamped(stamp_ns, DropReason.STAMP_BACK)
        stream.back.append(stamp_ns)
        if len(stream.back) < self._lasting_messages:
            return Stamped(stamp_ns, DropReason.STAMP_BACK)
        step_ns = stream.back[-1] - stream.back[0]
        shift_ns = stream.newest_ns + max(stream.interval_ns, 1) + step_ns - stamp_ns
        self.offset_ns += shift_ns
        self.jumps += 1
        self.newest_ns = stream.newest_ns = stamp_ns + shift_ns
        stream.back.clear()
        return Stamped(stamp_ns + shift_ns, shift_ns=shift_ns)

    def _follow(self, stream: _Stream, stamp_ns: int, shift_ns: int = 0) -> Stamped:
        stream.ahead.clear()
        stream.back.clear()
        if stamp_ns - stream.newest_ns > self._lasting_jump_ns:
            self.wide_steps.append((stream.newest_ns, stamp_ns))
            self.jumps += 1
        else:
            self.jumps += shift_ns != 0
        self.interval_ns = stream.interval_ns = min(stamp_ns - stream.newest_ns, self._leap_ns)
        self.newest_ns = stream.newest_ns = stamp_ns
        return Stamped(stamp_ns, shift_ns=shift_ns)


def told_of(was_set_ns: int, offset_ns: int) -> str:
    """What is told of a clock that was set by `was_set_ns`, and whose stamps are shifted by `offset_ns` since then."""
    where = "back" if was_set_ns < 0 else "forward"
    set_s, offset_s = abs(was_set_ns) / SECOND_NS, offset_ns / SECOND_NS
    return f"its clock was set {where} by {set_s:.3f} s; its stamps are shifted by {offset_s:+.3f} s from here on"
