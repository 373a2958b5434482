"""Recordings into a drive: a plain one message by message, a black box as the daemon went through it."""

from typing import Protocol

from wayfi.recordings.mcap.blocks import Record
from wayfi.recordings.ros.topics import CONTROL_TOPIC, Route, route
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
    """Where the records' channels lead, looked up once each; what leads nowhere is kept in `unused`."""

    def __init__(self, drive: Drive) -> None:
        self._topics = drive.topics
        self._known: dict[tuple[str, str, str], Route] = {}
        self.unused: dict[str, str] = {}

    def of(self, record: Record) -> Route:
        """The route of a record."""
        channel = (record.topic, record.type_name, record.encoding)
        if channel not in self._known:
            self._known[channel] = found = route(*channel, self._topics)
            if not found.used:
                self.unused[record.topic] = found.why
        return self._known[channel]


class PlainReplayer:
    """Every message is processed before its pose is published."""

    def __init__(self, drive: Drive) -> None:
        self.drive = drive
        self._routes = _Routes(drive)
        self.unused = self._routes.unused

    def play(self, record: Record) -> None:
        """Feed the record, if it is a sensor's."""
        found = self._routes.of(record)
        if found.sensor is not None and found.encoding is not None:
            self.drive.show(self.drive.feed(found.sensor, found.encoding, record.data))


class BlackBoxReplayer:
    """Does what the daemon did: a pose is published on the estimate that the daemon had, a restart is a restart."""

    def __init__(self, live: LiveDrive) -> None:
        self.live = live
        self._routes = _Routes(live.drive)
        self.unused = self._routes.unused

    @property
    def drive(self) -> Drive:
        """The drive so far; another one after a checkpoint."""
        return self.live.drive

    def play(self, record: Record) -> None:
        """Feed the record, or do what its mark says."""
        if record.topic == CONTROL_TOPIC:
            self._obey(record.data)
            return
        found = self._routes.of(record)
        if found.sensor is not None and found.encoding is not None:
            events, _ = self.live.feed(found.sensor, found.encoding, record.data)
            self.live.new_estimate()
            self.drive.show(events)

    def _obey(self, data: bytes) -> None:
        try:
            mark = parse_control_record(data)
        except ControlRecordError as error:
            self.drive.counters.warn(str(error))
            return
        self.drive.show(self.live.obey(mark))
        self.live.new_estimate()
