"""Real time, or a multiple of it."""

import time
from collections.abc import Callable

from wayfi.frontends.measurements import SECOND_NS

LONGEST_GAP_NS = 60 * SECOND_NS  # sensors send every second: a longer gap is a clock's, or between two drives
WAIT_AT_ONCE_S = 0.1
_YEAR_S = 365.25 * 86_400.0


class PlaybackRate:
    """Holds messages back so that log time passes `rate` times as fast as real time; without a rate, nothing is held.

    A gap between log times of more than `LONGEST_GAP_NS` is not waited for.
    """

    def __init__(self, rate: float | None) -> None:
        self._rate = rate
        self._start: tuple[float, int] | None = None
        self._latest_ns = 0
        self._played_ns = 0
        self._gaps: list[tuple[int, int]] = []

    @property
    def played_s(self) -> float:
        """Seconds of log time so far, without what was not waited for."""
        return self._played_ns / SECOND_NS

    @property
    def warnings(self) -> list[str]:
        """A line on the gaps, if there were any."""
        if not self._gaps:
            return []
        at_ns, length_ns = self._gaps[0]
        others = f", and {len(self._gaps) - 1} more of over a minute" if len(self._gaps) > 1 else ""
        gap = f"a gap of {_duration_text(length_ns / SECOND_NS)} behind log time {at_ns / SECOND_NS:.1f} s"
        return [f"the recording has {gap}{others}; a playback rate does not wait for it"]

    def wait_for(self, log_time_ns: int, stopped: Callable[[], bool] = lambda: False) -> None:
        """Sleep until a message of this log time is due, or `stopped` says that the wait is to end."""
        step_ns = 0 if self._start is None else log_time_ns - self._latest_ns
        if step_ns > LONGEST_GAP_NS:
            self._gaps.append((self._latest_ns, step_ns))
        if self._start is None or abs(step_ns) > LONGEST_GAP_NS:
            self._start = (time.monotonic(), log_time_ns)
        else:
            self._played_ns += step_ns
        self._latest_ns = log_time_ns
        if self._rate is not None:
            _wait_until(self._start[0] + (log_time_ns - self._start[1]) / SECOND_NS / self._rate, stopped)


def _wait_until(due: float, stopped: Callable[[], bool]) -> None:
    while (remaining_s := due - time.monotonic()) > 0 and not stopped():
        time.sleep(min(remaining_s, WAIT_AT_ONCE_S))


def _duration_text(seconds: float) -> str:
    return f"{seconds / _YEAR_S:.1f} years" if seconds > _YEAR_S else f"{seconds:.0f} s"
