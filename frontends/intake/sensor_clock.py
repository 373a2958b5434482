"""Brings the stamps of a laser or a WiFi receiver onto the odometry's: one offset each, as each has its own clock.

A clock that is set shows twice: the sensor's own stamps jump, and so does its lag, which is how far its stamp is behind
the odometry's newest when it comes in. A pause of the sensor changes its stamps alone, congestion its lag alone. Where
messages are seconds apart, the odometry may come after the sensor's message of the same stamp: then lags are as uneven
as its intervals, and its next stamp tells whether the message was ahead.
"""

from collections import deque
from collections.abc import Callable, Iterable

from wayfi.frontends.events import DropReason
from wayfi.frontends.intake.still_stamps import StillStamps
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.odometry_config import ClockConfig
from wayfi.frontends.odometry.timebase import Stamped, TimeBase, told_of

ALIKE_NS = SECOND_NS // 2  # lags this near to each other are of one offset: in congestion that clears they differ more
LONGEST_DOUBT_NS = 10 * SECOND_NS  # without odometry: lags say nothing as long as that pauses
MOST_AHEAD_NS = SECOND_NS // 2  # of the odometry, by the latency of its driver; further ahead is another clock


class SensorClock:
    """Accepts the stamps of one sensor in the order they come, and gives them on the time base of the odometry.

    After a step `lasting_messages` in a row, each after other odometry, have to agree on the new offset; those before
    the last are dropped. Where the stamps do not move, each message is stamped as the newest odometry.
    """

    def __init__(self, config: ClockConfig, odometry: TimeBase) -> None:
        self._jump_ns = round(config.lasting_jump_s * SECOND_NS)
        self._lasting = config.lasting_messages
        self._own = TimeBase(config)
        self._still = StillStamps(config.lasting_messages)
        self._placed_still = False
        self._odometry = odometry
        self._now_ns: int | None = None  # the odometry's newest stamp when the last message came in
        self._offset_ns, self._jumps = 0, odometry.jumps  # the odometry's, as above
        self._accepted_at_ns: int | None = None  # `_now_ns` of the last message that was accepted
        self._lags: deque[int] = deque(maxlen=config.lasting_messages)
        self._waits_ns = 0  # the stamp of the last message that came after odometry
        self._ahead: deque[int] = deque(maxlen=config.lasting_messages)  # of messages that the next odometry reached
        self._to_follow = (0, 0)  # a change of the odometry's offset, and for how many messages it may be this one's
        self._odometry_jumped = False
        self._undo_ns = 0  # the offset that would undo a jump of the sensor's own stamps; 0: they have not jumped
        self._off: list[int] = []  # how far off the lag is, of the messages in doubt that came after odometry
        self._doubted_ns = 0  # the stamp of the last of them

    def accept(self, stamp_ns: int, content: Callable[[], bytes]) -> Stamped:
        """The next message's stamp on the time base, or why it is dropped.

        `content` gives what the message holds; it is asked only where the message before has its stamp.
        """
        self._still.add(stamp_ns, self._odometry.newest_ns, content)
        if self._still.still:
            return self._stamp_by_arrival(stamp_ns)
        ended, self._placed_still = self._placed_still, False
        fresh = self._note_odometry()
        self._follow_odometry(stamp_ns)
        if fresh:
            self._waits_ns = stamp_ns + self._own.offset_ns
        stamped = self._judge(stamp_ns, fresh) or self._follow(stamp_ns, fresh)
        return stamped._replace(told="its stamps move again") if ended else stamped

    def _stamp_by_arrival(self, stamp_ns: int) -> Stamped:
        now_ns, first = self._odometry.newest_ns, not self._placed_still
        if now_ns is None or self._still.repeated or (not first and now_ns == self._own.newest_ns):
            return Stamped(stamp_ns + self._own.offset_ns, DropReason.DUPLICATE)
        self._placed_still = True
        self._own.shift(0, now_ns)
        return Stamped(now_ns, told=_told_still(stamp_ns) if first else "")

    def _note_odometry(self) -> bool:
        """Note what has become of the odometry's clock since the last message; returns whether odometry has come."""
        now, fresh = self._odometry, self._odometry.newest_ns != self._now_ns
        if fresh:
            self._note_reached()
        if now.offset_ns != self._offset_ns:
            self._to_follow = (self._to_follow[0] + now.offset_ns - self._offset_ns, self._lasting)
        self._odometry_jumped |= now.jumps != self._jumps
        self._now_ns, self._offset_ns, self._jumps = now.newest_ns, now.offset_ns, now.jumps
        return fresh

    def _note_reached(self) -> None:
        """Whether the odometry's next stamp has reached the last message: then that was ahead for want of it alone."""
        for before_ns, next_ns in self._odometry.wide_steps:
            if before_ns == self._now_ns and before_ns <= self._waits_ns <= next_ns:
                self._ahead.append(self._waits_ns - before_ns)
                self._off.clear()

    def _follow_odometry(self, stamp_ns: int) -> None:
        """Take over a change of the odometry's offset where that makes the lag usual: both clocks were set."""
        change_ns, left = self._to_follow
        off_ns = self._off_ns(stamp_ns + self._own.offset_ns)
        if abs(off_ns - change_ns) < abs(off_ns):
            self._own.shift(change_ns, self._own.newest_ns)
            left = 0
        self._to_follow = (change_ns, left - 1) if left > 1 else (0, 0)

    def _judge(self, stamp_ns: int, fresh: bool) -> Stamped | None:
        """What becomes of a message that may come after a step; None where nothing says that it does."""
        on_base_ns = stamp_ns + self._own.offset_ns
        off_ns = self._off_ns(on_base_ns)
        self._note_jump(on_base_ns)
        if self._off and not fresh and on_base_ns - self._doubted_ns <= LONGEST_DOUBT_NS:
            return Stamped(on_base_ns, self._doubt())
        if self._off and not (fresh and self._is_alike(off_ns)):
            self._off.clear()
        if not self._off and not (fresh and self._lags and self._may_be_step(on_base_ns, off_ns)):
            return None
        self._off.append(off_ns)
        self._doubted_ns = on_base_ns
        return self._step(on_base_ns) if len(self._off) == self._lasting else Stamped(on_base_ns, self._doubt())

    def _is_alike(self, off_ns: int) -> bool:
        """Whether a lag is off by as much as the first in doubt, but for how often odometry and sensor come."""
        first_ns = self._off[0]
        return abs(off_ns - first_ns) <= min(max(ALIKE_NS, self._own.interval_ns), abs(first_ns) // 2)

    def _note_jump(self, on_base_ns: int) -> None:
        if self._own.newest_ns is not None and not self._undo_ns:
            undo_ns = self._own.newest_ns + self._own.interval_ns - on_base_ns
            self._undo_ns = undo_ns if abs(undo_ns) > self._jump_ns else 0

    def _doubt(self) -> DropReason:
        """Why a message is dropped that may come after a step."""
        if self._undo_ns == 0:
            return DropReason.CLOCK_OFF
        return DropReason.STAMP_BACK if self._undo_ns > 0 else DropReason.STAMP_AHEAD

    def _may_be_step(self, on_base_ns: int, off_ns: int) -> bool:
        """Whether the lag is off by more than a lasting jump since the odometry's stamps have jumped, or the own."""
        assert self._now_ns is not None
        ahead = off_ns < 0 and on_base_ns - self._now_ns > MOST_AHEAD_NS
        jumped = (self._undo_ns < 0 and ahead) or (self._undo_ns > 0 and off_ns > 0)
        by_chance_ns = min(self._own.interval_ns, self._odometry.interval_ns)  # by which lags differ from each other
        by_chance_ns = max(by_chance_ns, *self._ahead, 0)
        if abs(off_ns) > self._jump_ns + by_chance_ns and (self._odometry_jumped or jumped):
            return True
        self._believe()
        return False

    def _believe(self) -> None:
        """Take the stamps as they are: there was no step, or it is corrected."""
        self._off.clear()
        self._odometry_jumped, self._undo_ns = False, 0

    def _step(self, on_base_ns: int) -> Stamped:
        shift_ns = _median(self._off)
        own = self._undo_ns and not self._odometry_jumped
        if self._undo_ns and self._agree(self._undo_ns, shift_ns):
            own, shift_ns = True, self._undo_ns
        self._own.shift(shift_ns, on_base_ns + shift_ns)
        told = told_of(-shift_ns, self._own.offset_ns) if own else _told_followed(shift_ns)
        self._believe()
        return Stamped(on_base_ns + shift_ns, shift_ns=shift_ns, told=told)

    def _follow(self, stamp_ns: int, fresh: bool) -> Stamped:
        """Accept a stamp that follows the sensor's own, or that shows that its clock was set back."""
        before_ns, on_base_ns = self._own.newest_ns, stamp_ns + self._own.offset_ns
        off_ns = self._off_ns(on_base_ns)
        stamped = self._own.accept(stamp_ns)
        if stamped.dropped:
            return stamped
        paused, self._accepted_at_ns = self._now_ns == self._accepted_at_ns, self._now_ns
        if stamped.shift_ns and before_ns is not None:
            by_lag_ns = off_ns if self._lags and not paused and on_base_ns + off_ns > before_ns else stamped.shift_ns
            return self._set(on_base_ns, stamped.shift_ns, by_lag_ns)
        if fresh and self._now_ns is not None:
            self._lags.append(self._now_ns - stamped.stamp_ns)
        return stamped

    def _set(self, on_base_ns: int, shift_ns: int, by_lag_ns: int) -> Stamped:
        """Undo that the clock was set: by `shift_ns` if the sensor did not pause meanwhile, else by its lag."""
        self._believe()
        if not self._agree(shift_ns, by_lag_ns):
            self._own.shift(by_lag_ns - shift_ns, on_base_ns + by_lag_ns)
            shift_ns = by_lag_ns
        told = told_of(-shift_ns, self._own.offset_ns)
        return Stamped(on_base_ns + shift_ns, shift_ns=shift_ns, told=told)

    def _agree(self, by_interval_ns: int, by_lag_ns: int) -> bool:
        """Whether two estimates of an offset differ by no more than the second one's error; the first is exact."""
        error_ns = max(self._own.interval_ns // 2, self._odometry.interval_ns)
        return abs(by_interval_ns - by_lag_ns) <= error_ns

    def _off_ns(self, on_base_ns: int) -> int:
        """How much longer the lag of a stamp is than it usually is; 0 as long as there is no odometry."""
        usual_ns = _median(self._lags) if self._lags else 0
        return self._now_ns - on_base_ns - usual_ns if self._now_ns is not None else 0


def _median(values: Iterable[int]) -> int:
    in_order = sorted(values)
    return in_order[(len(in_order) - 1) // 2]


def _told_still(stamp_ns: int) -> str:
    return (
        f"its stamps do not move, each is {stamp_ns / SECOND_NS:.3f} s; its messages are placed where the odometry is "
        "when they come in (fix header.stamp in its driver)"
    )


def _told_followed(shift_ns: int) -> str:
    return f"the odometry's clock was set without its own; its stamps are shifted by {shift_ns / SECOND_NS:+.3f} s"
