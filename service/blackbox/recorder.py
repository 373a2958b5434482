"""The black box kept going on a disk that may be full or broken: recording may stop, the robot does not."""

import time
from collections.abc import Callable
from pathlib import Path

from wayfi.recordings.mcap.recording import RecordingError
from wayfi.service.blackbox.blackbox import BlackBox
from wayfi.service.blackbox.disk import free_mb, keep_budget
from wayfi.service.config import RecordingConfig
from wayfi.service.drive.control_records import ControlRecord
from wayfi.service.transport.message_queue import Received

LOOK_S = 5.0
RETRY_S = 10.0


class Recorder:
    """Writes to the black box that `begin` opens, while there is room; tells `complain` when that changes."""

    def __init__(
        self, begin: Callable[[], BlackBox], folder: Path, config: RecordingConfig, complain: Callable[[str], None]
    ) -> None:
        self._begin = begin
        self._folder = folder
        self._config = config
        self._complain = complain
        self._blackbox: BlackBox | None = None
        self._looked_s = time.monotonic()
        self.unrecorded = 0
        self._guard(self._open)

    def write(self, item: Received | ControlRecord) -> None:
        """Record a message or a mark; counted in `unrecorded` where that is impossible."""
        if self._blackbox is None:
            self._try_again()
        if self._blackbox is None:
            self.unrecorded += 1
            return
        blackbox = self._blackbox
        self._guard(lambda: blackbox.write(item))
        self.look_after()

    @property
    def whole(self) -> bool:
        """Whether it has recorded everything so far, and goes on."""
        return self._blackbox is not None and not self.unrecorded

    def flush(self) -> None:
        """What is recorded so far survives a kill."""
        blackbox = self._blackbox
        if blackbox is not None:
            self._guard(blackbox.flush)

    def rotate_if_due(self) -> None:
        """Begin a new part where the last is large or old enough."""
        blackbox = self._blackbox
        if blackbox is not None:
            self._guard(blackbox.rotate_if_due)

    def look_after(self) -> None:
        """Flush, keep the budget, and stop where the disk is nearly full, each when its time has come."""
        blackbox = self._blackbox
        if blackbox is None:
            return
        self._guard(blackbox.flush_if_due)
        if time.monotonic() - self._looked_s >= LOOK_S:
            self._looked_s = time.monotonic()
            self._guard(self._look_at_disk)

    def close(self) -> None:
        """Finish the file."""
        if self._blackbox is not None:
            self._guard(self._blackbox.close)
            self._blackbox = None

    def _open(self) -> None:
        self._blackbox = self._begin()

    def _look_at_disk(self) -> None:
        keep_budget(self._folder.parent, self._folder, self._config.budget_mb)
        if free_mb(self._folder) < self._config.keep_free_mb:
            raise OSError(0, f"under {self._config.keep_free_mb:g} MiB are free (recording.keep_free_mb)")

    def _try_again(self) -> None:
        if time.monotonic() - self._looked_s < RETRY_S:
            return
        self._looked_s = time.monotonic()
        try:
            self._look_at_disk()
            self._open()
        except (OSError, RecordingError):
            return
        self._complain(f"recording again; {self.unrecorded} messages are missing from the black box")

    def _guard(self, act: Callable[[], object]) -> None:
        try:
            act()
        except (OSError, RecordingError, ValueError) as error:
            text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            self._stop(f"recording stopped: {text}; the robot goes on, and a replay ends here")

    def _stop(self, text: str) -> None:
        blackbox, self._blackbox = self._blackbox, None
        if blackbox is not None:
            blackbox.abandon()
        self._complain(text)
