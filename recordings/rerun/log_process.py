"""The Rerun log in a process of its own, so that drawing takes another core than estimating.

Events go to it pickled, over its standard input, and none is lost: where it is the slower of the two, the sender waits.
It finishes its file when that input ends, however the sender ended.
"""

import contextlib
import pickle
import queue
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wayfi.backend.errors import WayfiError
from wayfi.frontends.events import Event
from wayfi.recordings.rerun.config import RerunConfig

BATCH = 64  # messages to a pickle: one that is alone costs as much again
AHEAD = 100  # pickles that may wait to be taken: some 30 MB


@dataclass(frozen=True, slots=True)
class Part:
    """A file that a log is written to from now on, alone, and what is shown in it first; `served` live as well."""

    config: RerunConfig
    path: Path
    recording_id: str
    served: bool = False
    history: Sequence[Event] = ()


class LogProcessError(WayfiError):
    """The log could not be written."""


class LogProcess:
    """A RerunLog that runs beside: the same calls. Raises LogProcessError where it ended early."""

    def __init__(self, part: Part) -> None:
        command = [sys.executable, "-m", "wayfi.recordings.rerun.log_server"]
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the process
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=self._complaints)
        self._pickles: queue.Queue[bytes | None] = queue.Queue(AHEAD)
        self._writer = threading.Thread(target=self._write, name="log writer", daemon=True)
        self._writer.start()
        self._waiting: list[Any] = []
        self._send([part])

    def log(self, event: Event) -> None:
        """Show `event`."""
        self._add(event)

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Show how many seconds each stage took."""
        self._add(dict(durations))

    def begin(self, part: Part) -> None:
        """Finish the file, and go on in another."""
        self.flush()
        self._send([part])

    def flush(self) -> None:
        """Send what waits for a pickle of its own to fill."""
        if self._waiting:
            self._send(self._waiting)
            self._waiting = []

    @property
    def behind(self) -> bool:
        """Whether one more pickle would have to wait."""
        return self._pickles.full()

    def close(self) -> None:
        """Everything is in the file afterwards."""
        if self._complaints.closed:
            return
        self.flush()
        self._end()

    def _add(self, message: Event | dict[str, float]) -> None:
        self._waiting.append(message)
        if len(self._waiting) >= BATCH:
            self.flush()

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
                pipe.flush()
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
