"""The Rerun log of a daemon: files of bounded size, one after another, and live beside them; it holds nobody up."""

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
LOOK_S = 2.0
MIB = 1 << 20
RETRY_S = 30.0


class LiveLog:
    """Writes session_0001.rrd, session_0002.rrd, ... into `folder`; whoever opens a part sees the map up to there.

    `due` says that a part should begin: the last one is full, or the log could not keep up or ended, and what came
    since is not in it. `complain` is told what a person should know, one line each.
    """

    def __init__(self, config: RerunConfig, folder: Path, complain: Callable[[str], None]) -> None:
        self._config = config
        self._folder = folder
        self._complain = complain
        self._process: LogProcess | None = None
        self._path = folder
        self._sent_s = self._looked_s = self._ended_s = -RETRY_S
        self._full = False

    @property
    def due(self) -> bool:
        """Whether `begin` should be called."""
        if not self._config.enabled:
            return False
        if self._process is None:
            return time.monotonic() - self._ended_s >= RETRY_S
        return self._is_full() and not self._process.behind

    def begin(self, history: Sequence[Event]) -> None:
        """Begin the next part, in which `history` is shown first."""
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
        """Show `event`, if the log keeps up."""
        self._offer(lambda process: process.log(event))

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Show how many seconds each stage took, if the log keeps up."""
        self._offer(lambda process: process.log_durations(durations))

    def close(self) -> None:
        """Everything is in the file afterwards."""
        if self._process is not None:
            with self._guarded():
                self._process.close()
            self._process = None

    def _offer(self, give: Callable[[LogProcess], None]) -> None:
        process = self._process
        if process is None or self._full:
            return
        if process.behind:
            self._full = True
            self._complain("the Rerun log does not keep up: a part of the drive is left out of it")
            return
        with self._guarded():
            give(process)
            if time.monotonic() - self._sent_s >= SEND_S:
                process.flush()
                self._sent_s = time.monotonic()

    def _is_full(self) -> bool:
        if time.monotonic() - self._looked_s >= LOOK_S:
            self._looked_s = time.monotonic()
            with contextlib.suppress(OSError):
                self._full = self._full or self._path.stat().st_size > self._config.part_mb * MIB
        return self._full

    def _is_port_free(self) -> bool:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", self._config.port))
            except OSError:
                self._complain(f"no live view: 127.0.0.1:{self._config.port} is in use; see rerun.port")
                return False
        return True

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        """An end of the log is told, and tried again later."""
        try:
            yield
        except LogProcessError as error:
            self._process = None
            self._ended_s = time.monotonic()
            self._complain(f"{error}; begun anew in {RETRY_S:.0f} s")
