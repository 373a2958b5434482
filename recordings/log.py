"""Where events go to be looked at: a Rerun log, or nowhere."""

from collections.abc import Mapping
from typing import Protocol

from wayfi.frontends.events import Event


class Log(Protocol):
    """Takes events, in the order of the pipeline, and durations of stages; one thread."""

    def log(self, event: Event) -> None:
        """Show `event`."""

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Show how many seconds each stage took."""

    def close(self) -> None:
        """Everything is in the file afterwards."""


class NullLog:
    """Shows nothing."""

    def log(self, event: Event) -> None:
        """Do nothing."""

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""
