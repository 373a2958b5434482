"""Limits what is logged to a rate."""

from wayfi.frontends.measurements import SECOND_NS


class Limiter:
    """Limits a rate to `hz`, in the time of the recording."""

    def __init__(self, hz: float) -> None:
        self._interval_ns = round(SECOND_NS / hz)
        self._next_ns: int | None = None

    def passes(self, stamp_ns: int) -> bool:
        """Whether an interval has passed since the last stamp that passed; also true if time has gone back."""
        if self._next_ns is not None and self._next_ns - self._interval_ns <= stamp_ns < self._next_ns:
            return False
        self._next_ns = stamp_ns + self._interval_ns
        return True
