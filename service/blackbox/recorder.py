"""Records to the black box; a disk that is full or broken stops the recording, never the robot."""

import time
from collections.abc import Callable
from pathlib import Path

from wayfi.recordings.mcap.blocks import RecordingError
from wayfi.service.blackbox.blackbox import BlackBox
from wayfi.service.blackbox.disk import free_mb, keep_budget
from wayfi.service.config import RecordingConfig
from wayfi.service.drive.control_records import ControlRecord
from wayfi.service.transport.message_queue import Received

CHECK_S = 5.0
RETRY_S = 10.0


class Recorder:
    """Writes to the black box that `open_blackbox` opens, while there is room; calls `warn` when that changes.

    `unrecorded` counts the messages and control records that could not be written.
    """

    def __init__(
        self, open_blackbox: Callable[[], BlackBox], folder: Path, config: RecordingConfig, warn: Callable[[str], None]
    ) -> None:
        self._open_blackbox = open_blackbox
        self._folder = folder
        self._config = config
        self._warn = warn
        self._blackbox: BlackBox | None = None
        self._checked_s = time.monotonic()
        self.unrecorded = 0
        self._guard(self._open)

    def write(self, item: Received | ControlRecord) -> None:
        """Record a message or a control record, or count it in `unrecorded`."""
        if self._blackbox is None:
            self._reopen_if_due()
        if self._blackbox is None:
            self.unrecorded += 1
            return
        blackbox = self._blackbox
        self._guard(lambda: blackbox.write(item))
        self.maintain()

    @property
    def whole(self) -> bool:
        """Whether everything so far is recorded, and recording goes on."""
        return self._blackbox is not None and not self.unrecorded

    def flush(self) -> None:
        """Hand everything to the operating system: a killed process loses none of it."""
        blackbox = self._blackbox
        if blackbox is not None:
            self._guard(blackbox.flush)

    def rotate_if_due(self) -> None:
        """Begin a new part where the last is large or old enough."""
        blackbox = self._blackbox
        if blackbox is not None:
            self._guard(blackbox.rotate_if_due)

    def maintain(self) -> None:
        """Flush, delete what exceeds the budget, and stop where the disk is nearly full, each when it is due."""
        blackbox = self._blackbox
        if blackbox is None:
            return
        self._guard(blackbox.flush_if_due)
        if time.monotonic() - self._checked_s >= CHECK_S:
            self._checked_s = time.monotonic()
            self._guard(self._check_disk)

    def close(self) -> None:
        """Finish the file."""
        if self._blackbox is not None:
            self._guard(self._blackbox.close)
            self._blackbox = None

    def _open(self) -> None:
        self._blackbox = self._open_blackbox()

    def _check_disk(self) -> None:
        keep_budget(self._folder.parent, self._folder, self._config.budget_mb)
        if free_mb(self._folder) < self._config.keep_free_mb:
            raise OSError(0, f"under {self._config.keep_free_mb:g} MiB are free (recording.keep_free_mb)")

    def _reopen_if_due(self) -> None:
        if time.monotonic() - self._checked_s < RETRY_S:
            return
        self._checked_s = time.monotonic()
        try:
            self._check_disk()
            self._open()
        except (OSError, RecordingError):
            return
        self._warn(f"recording again; {self.unrecorded} messages are missing from the black box")

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
        self._warn(text)
