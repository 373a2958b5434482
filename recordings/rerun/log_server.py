"""The main program of a LogProcess: it logs the messages from its standard input until that ends."""

import contextlib
import os
import pickle
import signal
import sys

from wayfi.backend.errors import WayfiError
from wayfi.frontends.events import Event
from wayfi.recordings.log import Log, NullLog
from wayfi.recordings.rerun.log_process import Part
from wayfi.recordings.rerun.rerun_log import RerunLog


def _serve() -> None:
    """Log the messages from standard input until it ends."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    source = sys.stdin.buffer
    logs = _Logs()
    with contextlib.suppress(EOFError, pickle.UnpicklingError):  # the pipe was closed, perhaps within a message
        while True:
            for message in pickle.load(source):
                logs.add(message)
    logs.close()


class _Logs:
    """The log to the current file, and the live log, which exists from the first served part on."""

    def __init__(self) -> None:
        self._file: Log = NullLog()
        self._live: Log | None = None

    def add(self, message: Part | Event | dict[str, float]) -> None:
        """Show an event or durations, or begin the next file."""
        if isinstance(message, Part):
            self._begin(message)
            return
        for log in (self._file, self._live or NullLog()):
            if isinstance(message, dict):
                log.log_durations(message)
            else:
                log.log(message)

    def close(self) -> None:
        """Finish both logs."""
        self._file.close()
        if self._live is not None:
            self._live.close()

    def _begin(self, part: Part) -> None:
        self._file.close()
        self._file = RerunLog(part.config, part.path, recording_id=part.recording_id)
        new_logs: list[Log] = [self._file]
        if part.served and self._live is None:
            self._live = RerunLog(part.config, None, serve=True, recording_id=part.recording_id)
            new_logs.append(self._live)
        for log in new_logs:
            for event in part.history:
                log.log(event)


if __name__ == "__main__":
    try:
        _serve()
    except WayfiError as error:
        print(error, file=sys.stderr, flush=True)  # noqa: T201 - LogProcess reads it
        os._exit(1)  # a stream whose file cannot be written would keep the interpreter from ending
