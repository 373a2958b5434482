"""The Rerun log in a process of its own, so that logging and estimation use different cores.

Events are pickled and sent to its standard input. None is lost: a sender that is faster has to wait. The process
finishes its file when its input ends, even if the sender was killed.
"""

import contextlib
import pickle
import queue
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wayfi.backend.errors import WayfiError
from wayfi.frontends.events import Event, PosePublished
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.limiter import Limiter

BATCH = 64  # messages in a pickle; a pickle for each message doubles the time
MAX_QUEUED = 100  # pickles, about 30 MB
STALLED_S = 30.0  # a process that is busy for so long and writes nothing waits for ever: Rerun does on a full disk


@dataclass(frozen=True, slots=True)
class Part:
    """The next file of a log. It starts with the events `history`; with `served`, the log is also served live."""

    config: RerunConfig
    path: Path
    recording_id: str
    served: bool = False
    history: Sequence[Event] = ()


class LogProcessError(WayfiError):
    """The log process failed; its file may be incomplete."""


class LogProcess:
    """A RerunLog in another process, with the same calls. They raise LogProcessError if the process has failed."""

    def __init__(self, part: Part) -> None:
        command = [sys.executable, "-m", "wayfi.recordings.rerun.log_server"]
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the process
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=self._stderr)
        self._pickles: queue.Queue[bytes | None] = queue.Queue(MAX_QUEUED)
        self._stalled = False
        self._writer = threading.Thread(target=self._write, name="log writer", daemon=True)
        self._writer.start()
        self._batch: list[Any] = []
        self._poses = _DrawnPoses(part.config.pose_hz)
        self._path = part.path
        self._send([part])

    def log(self, event: Event) -> None:
        """Show `event`."""
        for drawn in self._poses.of(event):
            self._add(drawn)

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Show how many seconds each stage took."""
        self._add(dict(durations))

    def begin(self, part: Part) -> None:
        """Finish the current file and continue in that of `part`."""
        self.flush()
        self._path = part.path
        self._send([part])

    def flush(self) -> None:
        """Send the messages of the incomplete batch."""
        if self._batch:
            self._send(self._batch)
            self._batch = []

    @property
    def behind(self) -> bool:
        """Whether the queue is full: the next batch would wait."""
        return self._pickles.full()

    def close(self) -> None:
        """Wait until everything is in the file, and end the process."""
        if self._stderr.closed:
            return
        self.flush()
        self._end()

    def _add(self, message: Event | dict[str, float]) -> None:
        self._batch.append(message)
        if len(self._batch) >= BATCH:
            self.flush()

    def _send(self, value: Any) -> None:  # noqa: ANN401 - a batch of messages, or of one Part
        if self._process.poll() is not None:
            self._end()
        data = pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)
        self._patiently(lambda: self._put(data))

    def _write(self) -> None:
        """Write queued pickles to the process; discard them once the process has ended."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError), self._process.stdin as pipe:
            while (data := self._pickles.get()) is not None:
                pipe.write(data)
                pipe.flush()
            return
        while self._pickles.get() is not None:
            pass

    def _end(self) -> None:
        """Wait for the process to end. Raises LogProcessError with its last line on stderr if it failed."""
        if self._stderr.closed:
            return
        self._patiently(lambda: self._put(None))
        self._patiently(self._has_ended)
        code = self._process.wait()
        with self._stderr as stderr:
            stderr.seek(0)
            lines = stderr.read().decode(errors="replace").strip().splitlines()
        if self._stalled:
            raise LogProcessError(f"{self._path}: cannot be written to its end: is the disk full?")
        if code:
            raise LogProcessError(f"the log ended early: {lines[-1] if lines else f'code {code}'}")

    def _put(self, data: bytes | None) -> bool:
        """Whether `data` could be queued within `STALLED_S`."""
        try:
            self._pickles.put(data, timeout=STALLED_S)
        except queue.Full:
            return False
        return True

    def _has_ended(self) -> bool:
        """Whether the process ends within `STALLED_S`."""
        try:
            self._process.wait(STALLED_S)
        except subprocess.TimeoutExpired:
            return False
        self._writer.join()
        return True

    def _patiently(self, succeeds: Callable[[], bool]) -> None:
        """Repeat until it succeeds; kill the process where it neither takes messages nor writes meanwhile."""
        before = self._progress()
        while not succeeds():
            now = self._progress()
            if now == before:
                self._stalled = True
                self._process.kill()
            before = now

    def _progress(self) -> tuple[int, int]:
        size = self._path.stat().st_size if self._path.exists() else 0
        return self._pickles.qsize(), size


class _DrawnPoses:
    """Leaves out the poses that are not drawn, nine of ten: to pickle them takes longer than anything else.

    Those are kept that the views draw, at `hz` or half of it, a new state, and the newest before any other event.
    """

    def __init__(self, hz: float) -> None:
        self._limits = Limiter(hz), Limiter(hz / 2)
        self._newest: PosePublished | None = None
        self._is_sent = True

    def of(self, event: Event) -> list[Event]:
        """The events that are to be sent now that `event` has come."""
        before, was_sent = self._newest, self._is_sent
        if not isinstance(event, PosePublished):
            self._is_sent = True
            return [event] if before is None or was_sent else [before, event]
        passes = [limit.passes(event.stamp_ns) for limit in self._limits]
        self._newest, self._is_sent = event, any(passes) or before is None or event.state is not before.state
        return [event] if self._is_sent else []
