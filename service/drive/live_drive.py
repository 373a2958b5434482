"""A drive as a daemon has it: messages, and between them what the daemon did, as its black box holds both."""

import pickle
import traceback
from pathlib import Path
from typing import Self

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import Dropped, DropReason, Event, PosePublished, Warned
from wayfi.frontends.measurements import Measurement, Odometry, Sensor
from wayfi.frontends.odometry.live_pose import Estimate, LivePose
from wayfi.recordings.log import Log
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import Config
from wayfi.service.drive.control_records import ControlKind, ControlRecord
from wayfi.service.drive.drive import Drive


class LiveDrive:
    """The same messages and marks in the same order give the same drive, with the same poses published.

    It has a live pose of its own, which does what the daemon's does, one message after the other. `told` is the
    number of its newest estimate, `checkpoints` that of its newest checkpoint.
    """

    def __init__(self, config: Config, calibration: Calibration | None, log: Log) -> None:
        self.drive = Drive(config, calibration, log)
        self._wheels = calibration.wheels if calibration else None
        self._live = LivePose(config.odometry, self._wheels)
        self._estimates: dict[int, Estimate] = {}
        self.told = 0
        self.checkpoints = 0

    def feed(self, sensor: Sensor, encoding: Encoding, data: bytes) -> tuple[list[Event], PosePublished | None]:
        """Take a message; returns what became known by it, and the pose that the live pose gave for it before."""
        measurement = self.drive.decode(sensor, encoding, data)
        if measurement is None:
            return [], None
        published = self._live.add(measurement) if isinstance(measurement, Odometry) else None
        try:
            return self.drive.process(measurement, published), published
        except Exception as error:
            return self._failed(sensor, measurement, error), published

    def _failed(self, sensor: Sensor, measurement: Measurement, error: Exception) -> list[Event]:
        """A fault of ours, not of the message; a robot that nobody watches goes on all the same."""
        place = traceback.extract_tb(error.__traceback__)[-1]
        text = f"internal error, please report it: {error!r} at {Path(place.filename).name}:{place.lineno}"
        dropped = Dropped(sensor, measurement.stamp_ns, DropReason.INTERNAL_ERROR)
        return [dropped, Warned(measurement.stamp_ns, text)]

    def new_estimate(self) -> Estimate | None:
        """The newest estimate, where it is another than what this returned last; to be asked after every message."""
        estimate = self.drive.pipeline.new_estimate(self.told + 1)
        if estimate is not None:
            self.told = estimate.serial
            self._estimates[estimate.serial] = pickle.loads(pickle.dumps(estimate))
        return estimate

    @classmethod
    def restored(cls, data: bytes, log: Log) -> Self:
        """The drive of a checkpoint, which logs to `log` from now on."""
        live: Self = pickle.loads(data)
        live.drive.log = log
        return live

    def checkpoint(self, number: int) -> bytes:
        """The drive as bytes, to go on from after a restart; this one goes on from them as well, and so alike."""
        self.checkpoints = number
        data = pickle.dumps(self, protocol=pickle.HIGHEST_PROTOCOL)
        vars(self).update(vars(self.restored(data, self.drive.log)))
        return data

    def obey(self, mark: ControlRecord) -> list[Event]:
        """Do what the daemon did."""
        match mark.kind:
            case ControlKind.CHECKPOINT:
                self.checkpoint(mark.number)
            case ControlKind.ADOPT:
                self._adopt(mark.number)
            case ControlKind.AWAY:
                return self._go_on(mark.number * 1e-3)
        return []

    def _adopt(self, serial: int) -> None:
        """Of a black box with a hole, the newest that there is in its place."""
        known = [number for number in self._estimates if number <= serial]
        if known:
            self._live.adopt(self._estimates[max(known)])
        for number in known:
            del self._estimates[number]

    def _go_on(self, seconds: float) -> list[Event]:
        """The daemon was away, and begins with a live pose that knows nothing yet."""
        self._estimates.clear()
        self._live = LivePose(self.drive.config.odometry, self._wheels)
        return self.drive.pipeline.resume(seconds)
