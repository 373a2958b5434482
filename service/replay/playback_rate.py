"""Real time, or a multiple of it."""

import time

from wayfi.frontends.measurements import SECOND_NS


class PlaybackRate:
    """Holds messages back to `rate` times the time between their log times; None does not."""

    def __init__(self, rate: float | None) -> None:
        self._rate = rate
        self._start: tuple[float, int] | None = None

    def wait_for(self, log_time_ns: int) -> None:
        """Sleep until a message of this log time is due."""
        if self._rate is None:
            return
        now = time.monotonic()
        if self._start is None:
            self._start = (now, log_time_ns)
        due = self._start[0] + (log_time_ns - self._start[1]) / SECOND_NS / self._rate
        if due > now:
            time.sleep(due - now)
