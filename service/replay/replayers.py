"""Recordings into a drive: a plain one message by message, a black box as the daemon went through it."""

from typing import Protocol

from wayfi.recordings.mcap.blocks import Record
from wayfi.recordings.ros.codec import encoding_of
from wayfi.recordings.ros.topics import CONTROL_TOPIC, Channel, Route, route
from wayfi.service.drive.control_records import ControlRecordError, parse_control_record
from wayfi.service.drive.drive import Drive
from wayfi.service.drive.live_drive import LiveDrive


class Replayer(Protocol):
    """Plays records, in their order, into `drive`; `unused` are the topics that feed no sensor, with the reason."""

    unused: dict[str, str]

    @property
    def drive(self) -> Drive:
        """The drive so far."""
        ...

    def play(self, record: Record) -> None:
        """Play the next record."""
        ...


class _Routes:
    """The routes of the records' channels, looked up once each; `unused` are topics without one, with the reason."""

    def __init__(self, drive: Drive) -> None:
        self._topics = drive.config.recording.every_topic
        self._known: dict[Channel, Route] = {}
        self.unused: dict[str, str] = {}

    def of(self, record: Record) -> Route:
        """The route of a record."""
        channel = Channel(record.topic, record.type_name, encoding_of(record.data, record.encoding))
        if channel not in self._known:
            self._known[channel] = found = route(*channel, self._topics)
            if not found.used:
                self.unused[record.topic] = found.why
        return self._known[channel]


class PlainReplayer:
    """Processes every message before its pose is published."""

    def __init__(self, drive: Drive) -> None:
        self.drive = drive
        self._routes = _Routes(drive)
        self.unused = self._routes.unused

    def play(self, record: Record) -> None:
        """Feed the record, if it is a sensor's."""
        found = self._routes.of(record)
        if found.sensor is not None and found.encoding is not None:
            self.drive.show(self.drive.feed(found.sensor, found.encoding, record.data, record.topic))


class BlackBoxReplayer:
    """Repeats what the daemon did: each pose is based on the estimate that the daemon had adopted."""

    def __init__(self, live: LiveDrive) -> None:
        self.live = live
        self._routes = _Routes(live.drive)
        self.unused = self._routes.unused

    @property
    def drive(self) -> Drive:
        """The drive so far; another one after a checkpoint."""
        return self.live.drive

    def play(self, record: Record) -> None:
        """Feed the record's message, or apply its control record."""
        if record.topic == CONTROL_TOPIC:
            self._apply(record.data)
            return
        found = self._routes.of(record)
        if found.sensor is not None and found.encoding is not None:
            events, _ = self.live.feed(found.sensor, found.encoding, record.data, record.topic)
            self.live.new_estimate()
            self.drive.show(events)

    def _apply(self, data: bytes) -> None:
        try:
            control = parse_control_record(data)
        except ControlRecordError as error:
            self.drive.counters.warn(str(error))
            return
        self.drive.show(self.live.apply(control))
        self.live.new_estimate()
