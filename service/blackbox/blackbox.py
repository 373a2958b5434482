"""The black box: what the estimation was fed, in that order, so that a replay gives the same drive."""

import time
from contextlib import suppress
from pathlib import Path

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.closing import Closing
from wayfi.recordings.files.calibration_file import calibration_toml
from wayfi.recordings.mcap.parts import BLACKBOX, next_part
from wayfi.recordings.mcap.recording import BLACKBOX_PROFILE
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR
from wayfi.recordings.ros.topics import CONTROL_TOPIC, CONTROL_TYPE
from wayfi.service.blackbox.disk import MIB
from wayfi.service.config import Config, config_toml
from wayfi.service.drive.control_records import ControlRecord
from wayfi.service.drive.known_map import MapReference
from wayfi.service.transport.message_queue import Received

CONFIG = "config.toml"
CALIBRATION = "calibration.toml"
MAP = "map.json"
FLUSH_S = 0.5  # half of the second that a killed process may lose; the other half is for a long step


class BlackBox(Closing):
    """Writes `folder`/blackbox_0001.mcap, 0002, ..., each with configuration, calibration and map reference.

    A message's log time is when it was received, on a wall clock without jumps. A method that raises OSError or
    RecordingError has not recorded.
    """

    def __init__(
        self, folder: Path, config: Config, calibration: Calibration | None, known: MapReference | None = None
    ) -> None:
        self._folder = folder
        self._limits = config.recording
        self._wall_ahead_s = time.time() - time.monotonic()
        self._attached = {CONFIG: config_toml(config)}
        if calibration is not None:
            self._attached[CALIBRATION] = calibration_toml(calibration)
        if known is not None:
            self._attached[MAP] = known.to_json()
        self._begin()

    def write(self, item: Received | ControlRecord) -> None:
        """Write a message that is about to be fed, or a control record."""
        self._unflushed = True
        if isinstance(item, ControlRecord):
            self._writer.write(CONTROL_TOPIC, CONTROL_TYPE, "json", self._log_time_ns(time.monotonic()), item.to_json())
        else:
            log_time_ns = self._log_time_ns(item.received_s)
            self._writer.write(item.topic, TYPE_OF_SENSOR[item.sensor], item.encoding, log_time_ns, item.data)
        self.flush_if_due()

    def flush_if_due(self) -> None:
        """Flush where the last time is `FLUSH_S` ago."""
        if self._unflushed and time.monotonic() - self._flushed_s >= FLUSH_S:
            self.flush()

    def flush(self) -> None:
        """Hand everything to the operating system: a killed process loses none of it."""
        self._writer.flush()
        self._flushed_s = time.monotonic()
        self._unflushed = False

    def rotate_if_due(self) -> None:
        """Begin the next part where this one is large or old enough."""
        self.flush()
        full = self._writer.size_bytes > self._limits.part_mb * MIB
        old = time.monotonic() - self._begun_s > self._limits.part_minutes * 60
        if full or old:
            self.close()
            self._begin()

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()

    def abandon(self) -> None:
        """Close the file, whether or not the disk lets it be finished."""
        with suppress(OSError):
            self._writer.close()

    def _begin(self) -> None:
        self._writer = McapWriter(next_part(self._folder, BLACKBOX), BLACKBOX_PROFILE)
        for name, text in self._attached.items():
            self._writer.attach(name, text.encode(), f"application/{name.rpartition('.')[2]}")
        self._begun_s = time.monotonic()
        self.flush()

    def _log_time_ns(self, monotonic_s: float) -> int:
        return round((monotonic_s + self._wall_ahead_s) * SECOND_NS)
