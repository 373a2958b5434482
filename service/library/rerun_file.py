"""The Rerun file of a drive, whose failure stops no drive."""

import logging
import uuid
from collections.abc import Callable, Mapping
from pathlib import Path

from wayfi.frontends.events import Event
from wayfi.recordings.log import Log, NullLog
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.log_process import LogProcess, LogProcessError, Part

from .arguments import ArgumentError

_LOG = logging.getLogger("wayfi")


class RerunFile:
    """Logs events to the file `path` until that fails, of which the logger `wayfi` warns once.

    `warning` says why it failed, empty while it has not. Raises ArgumentError where the file cannot be written from
    the start.
    """

    def __init__(self, config: RerunConfig, path: Path) -> None:
        try:
            path.open("ab").close()
        except OSError as error:
            raise ArgumentError(f"rrd: must be a file that can be written; {path}: {error.strerror}") from None
        self._log: Log = LogProcess(Part(config, path, uuid.uuid4().hex[:16]))
        self.warning = ""

    def log(self, event: Event) -> None:
        """Show `event`."""
        self._try(lambda: self._log.log(event))

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Show how many seconds each stage took, by its name."""
        self._try(lambda: self._log.log_durations(durations))

    def close(self) -> None:
        """Finish the file."""
        self._try(self._log.close)

    def _try(self, use: Callable[[], None]) -> None:
        try:
            use()
        except LogProcessError as error:
            self._log = NullLog()
            self.warning = f"rrd: {error}"
            _LOG.warning("%s; the drive goes on without it", error)
