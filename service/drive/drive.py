"""One drive from its bytes to its files: decoding, the pipeline, the log and the counts, the same for every source."""

from typing import Any

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import DropReason, Event, GraphUpdated, PosePublished, Verdict
from wayfi.frontends.measurements import Measurement, Sensor
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.result import Result
from wayfi.recordings.log import Log, NullLog
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import Config
from wayfi.service.drive.counters import Counters
from wayfi.service.drive.timing import StageTimer


class Drive:
    """Feed it messages in their order; it never raises for what a message holds."""

    def __init__(self, config: Config, calibration: Calibration | None, log: Log) -> None:
        self.config = config
        self.topics = config.recording.topics
        self.counters = Counters(self.topics)
        self.timer = StageTimer()
        self.pipeline = Pipeline(config, calibration, self.timer)
        self.log = log

    def __getstate__(self) -> dict[str, Any]:
        """All but the log, which is open: whoever loads a drive gives it another."""
        return vars(self) | {"log": NullLog()}

    def feed(self, sensor: Sensor, encoding: Encoding, data: bytes) -> list[Event]:
        """Take one message; returns what became known by it, which is still to be shown."""
        measurement = self.decode(sensor, encoding, data)
        return [] if measurement is None else self.process(measurement)

    def add(self, sensor: Sensor, measurement: Measurement) -> list[Event]:
        """Count and process one measurement that came decoded; returns what became known by it, still to be shown."""
        self.counters.messages[self.topics[sensor]] += 1
        return self.process(measurement)

    def decode(self, sensor: Sensor, encoding: Encoding, data: bytes) -> Measurement | None:
        """Count one message and decode it; None where it says nothing."""
        topic = self.topics[sensor]
        self.counters.messages[topic] += 1
        try:
            with self.timer("decode"):
                return decode(data, sensor, encoding)
        except CodecError as error:
            if self.counters.drop(topic, DropReason.UNDECODABLE) == 1:
                self.counters.warn(f"{topic}: {error}")
            return None

    def process(self, measurement: Measurement, published: PosePublished | None = None) -> list[Event]:
        """Take what was decoded, and the pose that was published for it already, if one was."""
        with self.timer("process"):
            return self.pipeline.process(measurement, published)

    def show(self, events: list[Event]) -> None:
        """Count and log what `feed` returned; after it was published, for the log is the slower of the two."""
        with self.timer("log"):
            for event in events:
                self.counters.take(event)
                self.log.log(event)
            if any(isinstance(event, GraphUpdated) for event in events):
                self.log.log_durations(self.timer.take())

    def history(self) -> list[Event]:
        """What a log that begins now has to show first: the map, and the closures that hold it together."""
        accepted = [v for v in self.counters.verdicts.values() if v.verdict is Verdict.ACCEPTED]
        return self.pipeline.history() + accepted

    def finish(self) -> Result:
        """End the drive and close the log."""
        result, events = self.pipeline.finish()
        self.show(events)
        self.log.close()
        return result
