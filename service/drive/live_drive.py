"""A drive as in a daemon: messages, and between them the control records of what the daemon did."""

import pickle
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.closures.vetoes import VetoError
from wayfi.frontends.events import Dropped, DropReason, Event, PosePublished, Warned
from wayfi.frontends.measurements import Measurement, Odometry, Sensor
from wayfi.frontends.odometry.live_pose import Estimate, LivePose
from wayfi.recordings.log import Log, NullLog
from wayfi.recordings.map.saving import MapSaver
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import Config
from wayfi.service.drive.control_records import RESTORE, ControlKind, ControlRecord
from wayfi.service.drive.drive import Drive
from wayfi.service.drive.known_map import KnownMap
from wayfi.service.drive.map_pickling import MapPickling
from wayfi.service.drive.mode import Mode


class LiveDrive:
    """The same messages and control records in the same order give the same drive, with the same published poses.

    Its live pose repeats what the daemon's did. `newest` is the serial number of its newest estimate, `checkpoints` the
    number of its newest checkpoint; both are 0 before the first.
    """

    def __init__(
        self, config: Config, calibration: Calibration | None, log: Log, known: KnownMap | None = None
    ) -> None:
        building, extends = (known.building, known.mode is Mode.MAPPING) if known else (None, False)
        self.drive = Drive(config, calibration, log, building, extends)
        self.drive.former = known.name if known else None
        self._begins_map = known is None
        self._pickling = MapPickling(building)
        self._wheels = calibration.wheels if calibration else None
        self._live = self._new_live_pose()
        self._estimates: dict[int, Estimate] = {}
        self.newest = 0
        self.checkpoints = 0
        self.saver: MapSaver | None = None  # pickled with the drive: it knows by their identity which scans are saved

    def feed(
        self, sensor: Sensor, encoding: Encoding, data: bytes, topic: str = ""
    ) -> tuple[list[Event], PosePublished | None]:
        """Process a message; returns the events, and the pose that was published for it beforehand, if one was."""
        measurement = self.drive.decode(sensor, encoding, data, topic)
        if isinstance(measurement, list):
            return measurement, None
        published = self._live.add(measurement) if isinstance(measurement, Odometry) else None
        try:
            return self.drive.process(measurement, published), published
        except Exception as error:
            return self._failed(sensor, topic, measurement, error), published

    def _failed(self, sensor: Sensor, topic: str, measurement: Measurement, error: Exception) -> list[Event]:
        """The events of a message whose processing raised: a bug of wayfi, which must not stop the robot."""
        place = traceback.extract_tb(error.__traceback__)[-1]
        text = f"internal error, please report it: {error!r} at {Path(place.filename).name}:{place.lineno}"
        dropped = Dropped(sensor, measurement.stamp_ns, DropReason.INTERNAL_ERROR, topic)
        return [dropped, Warned(measurement.stamp_ns, text)]

    def new_estimate(self) -> Estimate | None:
        """The newest estimate, None where it is the one returned last; to be called after every message."""
        estimate = self.drive.pipeline.new_estimate(self.newest + 1)
        if estimate is not None:
            self.newest = estimate.serial
            self._estimates[estimate.serial] = pickle.loads(pickle.dumps(estimate))
        return estimate

    def __getstate__(self) -> dict[str, Any]:
        """Everything but what names the objects of the map."""
        return {name: value for name, value in vars(self).items() if name != "_pickling"}

    @classmethod
    def restored(cls, data: bytes, log: Log, known: KnownMap | None = None) -> Self:
        """The drive that `checkpoint` made these bytes of, in the same map; it logs to `log`."""
        return cls._unpickled(data, log, MapPickling(known.building if known else None))

    @classmethod
    def _unpickled(cls, data: bytes, log: Log, pickling: MapPickling) -> Self:
        live: Self = pickling.loads(data)
        live._pickling = pickling
        live.drive.log = log
        return live

    def copy(self) -> Self:
        """A drive that goes on as this one does; it logs nothing."""
        return self._unpickled(self._pickling.dumps(self), NullLog(), self._pickling)

    def checkpoint(self, number: int) -> bytes:
        """The pickled drive. This object becomes the unpickled copy, so that a resumed drive gives exactly the same."""
        self.checkpoints = number
        data = self._pickling.dumps(self)
        vars(self).update(vars(self._unpickled(data, self.drive.log, self._pickling)))
        return data

    def apply(self, record: ControlRecord) -> list[Event]:
        """Repeat what the daemon did; returns the events."""
        match record.kind:
            case ControlKind.CHECKPOINT:
                self.checkpoint(record.number)
            case ControlKind.ADOPT:
                self._adopt(record.number)
            case ControlKind.MODE:
                return self.drive.switch(Mode(record.text))
            case ControlKind.AWAY:
                return self._resume(record.number * 1e-3)
            case ControlKind.COMMAND if record.edits:
                with suppress(VetoError):  # which the daemon has told whoever asked
                    return self.edit(record)
        return []

    def _new_live_pose(self) -> LivePose:
        return LivePose(self.drive.config.odometry, self._wheels, begins_map=self._begins_map)

    def edit(self, record: ControlRecord) -> list[Event]:
        """Do what a command that edits the graph asks for; returns the events. Raises VetoError."""
        return self.drive.pipeline.edit(record.number, record.text == RESTORE)

    def _adopt(self, serial: int) -> None:
        """Base the live pose on the estimate of this number, or on the newest before where messages are missing."""
        known = [number for number in self._estimates if number <= serial]
        if known:
            self._live.adopt(self._estimates[max(known)])
        for number in known:
            del self._estimates[number]

    def _resume(self, seconds: float) -> list[Event]:
        """Resume after so many seconds without messages, with a live pose without any estimate."""
        self._estimates.clear()
        self._live = self._new_live_pose()
        return self.drive.pipeline.resume(seconds)
