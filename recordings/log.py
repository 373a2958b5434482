"""The interface of a log of events, and the log that does nothing."""

from collections.abc import Mapping
from typing import Protocol

from wayfi.frontends.events import Event


class Log(Protocol):
    """Shows events, in the order in which the pipeline gave them, and durations of stages. Not thread-safe."""

    def log(self, event: Event) -> None:
        """Show `event`."""

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Show how many seconds each stage took, by its name."""

    def close(self) -> None:
        """Finish the log: everything is in the file afterwards."""


class NullLog:
    """Shows nothing."""

    def log(self, event: Event) -> None:
        """Do nothing."""

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""
