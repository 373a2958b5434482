"""The Rerun log in a process of its own, so that drawing takes another core than estimating.

Events go to it pickled, over its standard input, and none is lost: where it is the slower of the two, the sender waits.
It finishes its file when that input ends, however the sender ended.
"""

import contextlib
import pickle
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wayfi.backend.errors import WayfiError
from wayfi.frontends.events import Event
from wayfi.recordings.rerun_config import RerunConfig

BATCH = 64  # messages to a pickle: one that is alone costs as much again
AHEAD = 100  # pickles that may wait to be taken: some 30 MB


class LogProcessError(WayfiError):
    """The log could not be written."""


class LogProcess:
    """A RerunLog that runs beside: the same calls, for a file alone. Raises LogProcessError where it ended early."""

    def __init__(self, config: RerunConfig, path: Path, recording_id: str) -> None:
        command = [sys.executable, "-m", __name__]
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the process
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=self._complaints)
        self._pickles: queue.Queue[bytes | None] = queue.Queue(AHEAD)
        self._writer = threading.Thread(target=self._write, name="log writer", daemon=True)
        self._writer.start()
        self._waiting: list[Any] = []
        self._send((config, path, recording_id))

    def log(self, event: Event) -> None:
        """Show `event`."""
        self._add(event)

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Show how many seconds each stage took."""
        self._add(dict(durations))

    def close(self) -> None:
        """Everything is in the file afterwards."""
        if self._complaints.closed:
            return
        self._send(self._waiting)
        self._waiting = []
        self._end()

    def _add(self, message: Event | dict[str, float]) -> None:
        self._waiting.append(message)
        if len(self._waiting) >= BATCH:
            self._send(self._waiting)
            self._waiting = []

    def _send(self, value: Any) -> None:  # noqa: ANN401 - whatever the other side takes
        if self._process.poll() is not None:
            self._end()
        self._pickles.put(pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL))

    def _write(self) -> None:
        """Hand pickles over as fast as they are taken; what comes after the other side has ended is let go."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError), self._process.stdin as pipe:
            while (data := self._pickles.get()) is not None:
                pipe.write(data)
            return
        while self._pickles.get() is not None:
            pass

    def _end(self) -> None:
        """Wait for the other side to finish; raises LogProcessError with its last word if it failed. Once only."""
        if self._complaints.closed:
            return
        self._pickles.put(None)
        self._writer.join()
        code = self._process.wait()
        with self._complaints as complaints:
            complaints.seek(0)
            lines = complaints.read().decode(errors="replace").strip().splitlines()
        if code:
            raise LogProcessError(f"the log ended early: {lines[-1] if lines else f'code {code}'}")


def _serve() -> None:
    """Log what comes on standard input until it ends."""
    from wayfi.recordings.rerun_log import RerunLog

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    source = sys.stdin.buffer
    config, path, recording_id = pickle.load(source)
    log = RerunLog(config, path, recording_id=recording_id)
    try:
        while True:
            for message in pickle.load(source):
                if isinstance(message, dict):
                    log.log_durations(message)
                else:
                    log.log(message)
    except (EOFError, pickle.UnpicklingError):  # the sender is done, or was killed within a message
        log.close()


if __name__ == "__main__":
    try:
        _serve()
    except WayfiError as error:
        sys.exit(str(error))
