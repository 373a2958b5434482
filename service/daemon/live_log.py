"""The daemon's Rerun log: files of bounded size, one after another, and a live view; nothing waits for it."""

import contextlib
import socket
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from wayfi.frontends.events import Event
from wayfi.recordings.mcap.parts import SESSION, next_part
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.log_process import LogProcess, LogProcessError, Part

SEND_S = 0.2
CHECK_S = 2.0
MIB = 1 << 20
RETRY_S = 30.0


class LiveLog:
    """Writes session_0001.rrd, session_0002.rrd, ... into `folder`; each part begins with the map so far.

    Calls `warn` with one line for a person where the log does not keep up or ends: what follows is not logged until the
    next part begins.
    """

    def __init__(self, config: RerunConfig, folder: Path, warn: Callable[[str], None]) -> None:
        self._config = config
        self._folder = folder
        self._warn = warn
        self._process: LogProcess | None = None
        self._path = folder
        self._sent_s = self._checked_s = self._ended_s = -RETRY_S
        self._full = False

    @property
    def due(self) -> bool:
        """Whether a part should begin: there is none, or it is full, or the log did not keep up and does so again."""
        if not self._config.enabled:
            return False
        if self._process is None:
            return time.monotonic() - self._ended_s >= RETRY_S
        return self._is_full() and not self._process.behind

    def begin(self, history: Sequence[Event]) -> None:
        """Begin the next part with the events of `history`."""
        self._path = next_part(self._folder, SESSION)
        served = self._process is not None or self._is_port_free()
        part = Part(self._config, self._path, f"wayfi-{self._folder.name}-{self._path.stem}", served, history)
        self._full = False
        with self._guarded():
            if self._process is None:
                self._process = LogProcess(part)
            else:
                self._process.begin(part)

    def log(self, event: Event) -> None:
        """Log `event`, if the log keeps up."""
        self._send(lambda process: process.log(event))

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Log how many seconds each stage took, if the log keeps up."""
        self._send(lambda process: process.log_durations(durations))

    def close(self) -> None:
        """Finish the file."""
        if self._process is not None:
            with self._guarded():
                self._process.close()
            self._process = None

    def _send(self, send: Callable[[LogProcess], None]) -> None:
        process = self._process
        if process is None or self._full:
            return
        if process.behind:
            self._full = True
            self._warn("the Rerun log does not keep up: a part of the drive is left out of it")
            return
        with self._guarded():
            send(process)
            if time.monotonic() - self._sent_s >= SEND_S:
                process.flush()
                self._sent_s = time.monotonic()

    def _is_full(self) -> bool:
        if time.monotonic() - self._checked_s >= CHECK_S:
            self._checked_s = time.monotonic()
            with contextlib.suppress(OSError):
                self._full = self._full or self._path.stat().st_size > self._config.part_mb * MIB
        return self._full

    def _is_port_free(self) -> bool:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", self._config.port))
            except OSError:
                self._warn(f"no live view: 127.0.0.1:{self._config.port} is in use; see rerun.port")
                return False
        return True

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        """Where the log's process has ended, warn; another is started after `RETRY_S`."""
        try:
            yield
        except LogProcessError as error:
            self._process = None
            self._ended_s = time.monotonic()
            self._warn(f"{error}; restarted in {RETRY_S:.0f} s")
