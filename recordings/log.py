"""The interface of a log of events, and the log that does nothing."""

from collections.abc import Mapping
from typing import Protocol

from wayfi.frontends.events import Event


class Log(Protocol):
    """Shows events, in the order in which the pipeline gave them, and durations of stages. Not thread-safe."""

    def log(self, event: Event) -> None:
        """Shows `event`."""

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Shows how many seconds each stage took, by its name."""

    def close(self) -> None:
        """Finishes the log: everything is in the file afterwards."""


class NullLog:
    """Shows nothing."""

    def log(self, event: Event) -> None:
        """Does nothing."""

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Does nothing."""

    def close(self) -> None:
        """Does nothing."""
