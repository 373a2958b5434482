"""`wayfi record`: what sensors put on Zenoh, into a plain recording."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.mcap.recording import McapWriter
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR
from wayfi.service.config import Config
from wayfi.service.process.stop_signal import StopSignal
from wayfi.service.transport.message_queue import MessageQueue, QueueLimit, Received
from wayfi.service.transport.subscribers import Subscribers
from wayfi.service.transport.zenoh_session import RefusedError, UnreachableError, open_guest_session, patiently

LIMIT = QueueLimit(messages=100_000, message_bytes=32 << 20)
IDLE_S = 0.1
FLUSH_S = 0.5


@dataclass(frozen=True, slots=True)
class RecordSummary:
    """How many messages of each topic were written, and how many were not, by reason."""

    messages: dict[str, int]
    dropped: dict[str, dict[str, int]]


def record_topics(out: Path, config: Config, ready: Callable[[], None] = lambda: None) -> RecordSummary:
    """Write the sensors' messages to `out` until SIGINT or SIGTERM; log times are those of receiving.

    `ready` is called when everything is subscribed to. Raises ZenohError where it is refused, or
    RecordingError where `out` cannot be written.
    """

    def may_come(error: UnreachableError) -> bool:
        return not isinstance(error, RefusedError) and not stop.requested

    topics = config.recording.topics
    inbox = MessageQueue[Received](dict.fromkeys(Sensor, LIMIT))
    with StopSignal() as stop, ExitStack() as opened:
        connect = partial(open_guest_session, config.zenoh)
        session = opened.enter_context(patiently(connect, may_come))
        writer = opened.enter_context(McapWriter(out))
        tape = _Tape(writer, topics)
        with Subscribers(session, config.zenoh, topics, inbox):
            ready()
            while not stop.requested:
                tape.write(inbox.pop(IDLE_S))
        while received := inbox.pop(0.0):
            tape.write(received)
    dropped = {topics[sensor]: reasons for sensor, reasons in inbox.dropped().items()}
    return RecordSummary(tape.messages, dropped)


class _Tape:
    """Writes messages, and hands them to the operating system twice a second."""

    def __init__(self, writer: McapWriter, topics: dict[Sensor, str]) -> None:
        self._writer = writer
        self._topics = topics
        self._wall_ahead_s = time.time() - time.monotonic()
        self._flushed_s = time.monotonic()
        self.messages: dict[str, int] = {}

    def write(self, received: Received | None) -> None:
        """Add a message, if there is one."""
        if received is not None:
            topic, type_name = self._topics[received.sensor], TYPE_OF_SENSOR[received.sensor]
            log_time_ns = round((received.received_s + self._wall_ahead_s) * 1e9)
            self._writer.write(topic, type_name, received.encoding, log_time_ns, received.data)
            self.messages[topic] = self.messages.get(topic, 0) + 1
        if time.monotonic() - self._flushed_s >= FLUSH_S:
            self._writer.flush()
            self._flushed_s = time.monotonic()
