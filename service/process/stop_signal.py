"""SIGINT and SIGTERM as a request that is checked between two messages."""

import signal
from threading import current_thread, main_thread
from types import FrameType, TracebackType
from typing import Self


class StopSignal:
    """While entered, the first SIGINT or SIGTERM sets `requested` and `name`; further ones change nothing.

    In another thread than the main one, which alone may handle signals, nothing is set.
    """

    def __init__(self) -> None:
        self.requested = False
        self.name = ""
        self._before: dict[signal.Signals, object] = {}

    def __enter__(self) -> Self:
        for number in (signal.SIGINT, signal.SIGTERM) if current_thread() is main_thread() else ():
            self._before[number] = signal.signal(number, self._handle)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    def _handle(self, number: int, _: FrameType | None) -> None:
        self.name = self.name or signal.Signals(number).name
        self.requested = True
