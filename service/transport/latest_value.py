"""Hands the latest value to a function that may be slow, in a thread of its own."""

import threading
from collections.abc import Callable

from wayfi.recordings.closing import Closing

CLOSE_S = 5.0


class LatestValue(Closing):
    """Calls `act` with the latest value that was put; earlier ones that still wait are discarded. A context manager."""

    def __init__(self, act: Callable[[bytes], None]) -> None:
        self._act = act
        self._value: bytes | None = None
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="latest value", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Wait until the last value is handled, for at most `CLOSE_S`."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join(CLOSE_S)

    def put(self, value: bytes) -> None:
        """Have `value` handled as soon as the present call returns, unless a later one replaces it."""
        with self._changed:
            self._value = value
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                while self._value is None and not self._closed:
                    self._changed.wait()
                value, self._value = self._value, None
            if value is None:
                return
            self._act(value)
