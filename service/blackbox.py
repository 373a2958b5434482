"""The black box: exactly what the pipeline was fed, in the order it was fed, so that a replay gives the same drive."""

import time
from pathlib import Path
from types import TracebackType
from typing import Self

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.measurements import Sensor
from wayfi.recordings.calibration_file import calibration_toml
from wayfi.recordings.mcap_log import BLACKBOX_PROFILE, McapWriter
from wayfi.recordings.messages import TYPE_OF_SENSOR
from wayfi.service.config import Config, config_toml
from wayfi.service.queues import Received

CONFIG = "config.toml"
CALIBRATION = "calibration.toml"
FLUSH_S = 0.5  # half of the second that a killed process may lose; the other half is for a step that takes long


class BlackBox:
    """Writes `folder`/blackbox_0001.mcap, with the configuration and the calibration in it; a context manager.

    A message's log time is the wall clock's when it was received, without the clock's own jumps.
    """

    def __init__(
        self, folder: Path, config: Config, topics: dict[Sensor, str], calibration: Calibration | None
    ) -> None:
        self._topics = topics
        self._wall_ahead_s = time.time() - time.monotonic()
        self._flushed_s = time.monotonic()
        self._unflushed = False
        self.path = folder / "blackbox_0001.mcap"
        self._writer = McapWriter(self.path, BLACKBOX_PROFILE)
        self._writer.attach(CONFIG, config_toml(config).encode(), "application/toml")
        if calibration is not None:
            self._writer.attach(CALIBRATION, calibration_toml(calibration).encode(), "application/toml")
        self._writer.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def write(self, received: Received) -> None:
        """Add a message that the pipeline is about to be fed."""
        sensor = received.sensor
        log_time_ns = round((received.received_s + self._wall_ahead_s) * 1e9)
        self._writer.write(self._topics[sensor], TYPE_OF_SENSOR[sensor], received.encoding, log_time_ns, received.data)
        self._unflushed = True
        self.flush_if_due()

    def flush_if_due(self) -> None:
        """Hand to the operating system what has been held back for `FLUSH_S`."""
        now_s = time.monotonic()
        if self._unflushed and now_s - self._flushed_s >= FLUSH_S:
            self._writer.flush()
            self._flushed_s = now_s
            self._unflushed = False

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()
