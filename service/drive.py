"""One drive from its bytes to its files: decoding, the pipeline, the log and the counts, the same for every source."""

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import DropReason, Event, GraphUpdated
from wayfi.frontends.measurements import Sensor
from wayfi.recordings.codec import decode
from wayfi.recordings.codec_error import CodecError
from wayfi.recordings.log import Log
from wayfi.recordings.topics import Encoding
from wayfi.service.config import Config, RecordingConfig
from wayfi.service.pipeline import Pipeline, Result
from wayfi.service.tally import Tally
from wayfi.service.timing import StageTimer


def topics_of(config: RecordingConfig) -> dict[Sensor, str]:
    """The topic of each sensor."""
    return {sensor: str(getattr(config, sensor.value)) for sensor in Sensor}


class Drive:
    """Feed it messages in their order; it never raises for what a message holds."""

    def __init__(self, config: Config, calibration: Calibration | None, log: Log) -> None:
        self.config = config
        self.topics = topics_of(config.recording)
        self.tally = Tally(self.topics)
        self.timer = StageTimer()
        self._pipeline = Pipeline(config, calibration, self.timer)
        self._log = log

    def feed(self, sensor: Sensor, encoding: Encoding, data: bytes) -> list[Event]:
        """Take one message; returns what became known by it, which is still to be shown."""
        topic = self.topics[sensor]
        self.tally.messages[topic] += 1
        try:
            with self.timer("decode"):
                measurement = decode(data, sensor, encoding)
        except CodecError as error:
            if self.tally.drop(topic, DropReason.UNDECODABLE) == 1:
                self.tally.warn(f"{topic}: {error}")
            return []
        with self.timer("process"):
            return self._pipeline.process(measurement)

    def show(self, events: list[Event]) -> None:
        """Count and log what `feed` returned; after it was published, for the log is the slower of the two."""
        with self.timer("log"):
            for event in events:
                self.tally.take(event)
                self._log.log(event)
            if any(isinstance(event, GraphUpdated) for event in events):
                self._log.log_durations(self.timer.take())

    def finish(self) -> Result:
        """End the drive and close the log."""
        result, events = self._pipeline.finish()
        self.show(events)
        self._log.close()
        return result
