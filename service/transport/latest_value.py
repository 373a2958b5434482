"""Hands values to whoever may take long over one: in a thread of its own, the newest in place of those before."""

import threading
from collections.abc import Callable

from wayfi.recordings.closing import Closing

LAST_S = 5.0


class LatestValue(Closing):
    """Calls `act` with the newest value that was put; a context manager, which at its end waits for the last."""

    def __init__(self, act: Callable[[bytes], None]) -> None:
        self._act = act
        self._value: bytes | None = None
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="newest only", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Wait for the last."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join(LAST_S)

    def put(self, value: bytes) -> None:
        """Have `value` acted on as soon as what is under way is done, unless another comes first."""
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
