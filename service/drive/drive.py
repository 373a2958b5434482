"""One drive: decoding, the pipeline, the log and the counters, the same for every source."""

from dataclasses import replace
from typing import Any

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import Dropped, DropReason, Event, GraphUpdated, PosePublished, Verdict, Warned
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.measurements import LaserScan, Measurement, Sensor
from wayfi.frontends.result import DriveEstimate
from wayfi.frontends.switching_pipeline import SwitchingPipeline
from wayfi.recordings.log import Log, NullLog
from wayfi.recordings.map.manifest import MapName
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import Config
from wayfi.service.drive.counters import Counters
from wayfi.service.drive.mode import Mode
from wayfi.service.drive.timing import StageTimer
from wayfi.service.drive.unused_streams import UnusedStreams


class Drive:
    """Decodes and processes messages in their order; no content of a message makes it raise.

    It makes a map; in one that is `known` it localises, or it `extends` that. `makes_map` says whether it has a map of
    its own to save, and `former` is the name that this had before; `begins_in_map`, whether one was known.
    """

    def __init__(
        self,
        config: Config,
        calibration: Calibration | None,
        log: Log,
        known: BuildingMap | None = None,
        extends: bool = False,
    ) -> None:
        self.config = config
        self.makes_map, self.begins_in_map = known is None or extends, known is not None
        self.former: MapName | None = None
        self.topics = config.recording.topics
        self.counters = Counters(self.topics)
        self.unused = UnusedStreams(self.topics)
        self.timer = StageTimer()
        self.pipeline = SwitchingPipeline(config, calibration, self.timer, known, extends)
        self.log = log

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the log, which is open; an unpickled drive has to be given another."""
        return vars(self) | {"log": NullLog()}

    def feed(self, sensor: Sensor, encoding: Encoding, data: bytes, topic: str = "") -> list[Event]:
        """Decode and process one message; returns the events, for `show`. `topic`: the sensor's first by default."""
        measurement = self.decode(sensor, encoding, data, topic)
        return measurement if isinstance(measurement, list) else self.process(measurement)

    def add(self, sensor: Sensor, measurement: Measurement) -> list[Event]:
        """Count and process one measurement that came decoded; returns what became known by it, still to be shown."""
        topic = self.topics[sensor]
        self.counters.messages[topic] += 1
        return self.process(_on(topic, measurement))

    def decode(self, sensor: Sensor, encoding: Encoding, data: bytes, topic: str = "") -> Measurement | list[Event]:
        """Count one message and decode it; the events of its drop where that is impossible, for `show`."""
        topic = topic or self.topics[sensor]
        self.counters.messages[topic] += 1
        try:
            with self.timer("decode"):
                return _on(topic, decode(data, sensor, encoding))
        except CodecError as error:
            stamp_ns = self.pipeline.stamp_ns
            first = DropReason.UNDECODABLE not in self.counters.dropped.get(topic, ())
            told: list[Event] = [Warned(stamp_ns, f"{topic}: cannot be decoded: {error}")] if first else []
            return [Dropped(sensor, stamp_ns, DropReason.UNDECODABLE, topic), *told]

    def process(self, measurement: Measurement, published: PosePublished | None = None) -> list[Event]:
        """Process a measurement, for which `published` has been published already; returns the events."""
        with self.timer("process"):
            events = self.pipeline.process(measurement, published)
        return events + self.unused.judge(self.counters.messages, events, self.pipeline.stamp_ns)

    def switch(self, mode: Mode) -> list[Event]:
        """Make the map, or localise in it, from now on; returns the events, for `show`."""
        self.makes_map |= mode is Mode.MAPPING
        with self.timer("switch"):
            return self.pipeline.switch(mode is Mode.LOCALIZATION)

    @property
    def mode(self) -> Mode:
        """What the drive does at present."""
        return Mode.LOCALIZATION if self.pipeline.localises else Mode.MAPPING

    def show(self, events: list[Event]) -> None:
        """Count and log events; to be called after they were published, because logging takes longer."""
        if not events:
            return
        with self.timer("log"):
            for event in events:
                self.counters.count(event)
            for event in events:
                self.log.log(event)
            if any(isinstance(event, GraphUpdated) for event in events):
                self.log.log_durations(self.timer.pop_durations())

    def history(self) -> list[Event]:
        """The events with which a new log has to begin: the map and the accepted closures."""
        accepted = [v for v in self.counters.verdicts.values() if v.verdict is Verdict.ACCEPTED]
        return self.pipeline.history() + accepted

    def finish(self) -> DriveEstimate:
        """End the drive, close the log and return the result."""
        result, events = self.pipeline.finish()
        events += self.unused.judge(self.counters.messages, events, self.pipeline.stamp_ns)
        self.show(events + self.unused.finish(self.counters.messages, self.pipeline.stamp_ns))
        self.log.close()
        return result


def _on(topic: str, measurement: Measurement) -> Measurement:
    """A measurement that came on this topic: scans of several are told apart by it."""
    return replace(measurement, topic=topic) if isinstance(measurement, LaserScan) else measurement
