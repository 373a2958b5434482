"""`wayfi record`: writes what sensors publish on Zenoh to a plain recording."""

import time
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.files.atomic_files import errors_naming
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR
from wayfi.service.config import Config
from wayfi.service.process.stop_signal import StopSignal
from wayfi.service.transport.message_queue import MessageQueue, QueueLimit, Received
from wayfi.service.transport.subscribers import Subscribers
from wayfi.service.transport.zenoh_session import RefusedError, UnreachableError, open_guest_session, open_with_retries

LIMIT = QueueLimit(messages=100_000, message_bytes=32 << 20)
IDLE_S = 0.1
FLUSH_S = 0.5


@dataclass(frozen=True, slots=True)
class RecordSummary:
    """How many messages of each topic were written, and how many were dropped, by topic and reason."""

    messages: dict[str, int]
    dropped: dict[str, dict[str, int]]


def record_topics(out: Path, config: Config) -> RecordSummary:
    """Write the sensors' messages to `out` until SIGINT or SIGTERM; a log time is when the message was received.

    Raises ZenohError where the connection is refused, RecordingError or OSError where `out` cannot be written.
    """
    _require_writable(out)

    def may_come(error: UnreachableError) -> bool:
        return not isinstance(error, RefusedError) and not stop.requested

    topics = config.recording.every_topic
    inbox = MessageQueue[Received]({topic: LIMIT for names in topics.values() for topic in names})
    with errors_naming(out), StopSignal() as stop, ExitStack() as opened:
        connect = partial(open_guest_session, config.zenoh)
        session = opened.enter_context(open_with_retries(connect, may_come))
        writer = opened.enter_context(McapWriter(out))
        recorder = _RecordingWriter(writer)
        with Subscribers(session, config.zenoh, topics, inbox):
            while not stop.requested:
                recorder.write(inbox.pop(IDLE_S))
        while received := inbox.pop(0.0):
            recorder.write(received)
    return RecordSummary(recorder.messages, inbox.dropped())


def _require_writable(path: Path) -> None:
    """Raise OSError now, not after the connection, where `path` cannot be written; a file there stays as it is."""
    is_new = not path.exists()
    path.open("ab").close()
    if is_new:
        path.unlink()


class _RecordingWriter:
    """Writes messages, and flushes them every `FLUSH_S`; `messages` counts them by topic."""

    def __init__(self, writer: McapWriter) -> None:
        self._writer = writer
        self._wall_ahead_s = time.time() - time.monotonic()
        self._flushed_s = time.monotonic()
        self.messages: dict[str, int] = {}

    def write(self, received: Received | None) -> None:
        """Write a message, if there is one, and flush when it is due."""
        if received is not None:
            topic, type_name = received.topic, TYPE_OF_SENSOR[received.sensor]
            log_time_ns = round((received.received_s + self._wall_ahead_s) * SECOND_NS)
            self._writer.write(topic, type_name, received.encoding, log_time_ns, received.data)
            self.messages[topic] = self.messages.get(topic, 0) + 1
        if time.monotonic() - self._flushed_s >= FLUSH_S:
            self._writer.flush()
            self._flushed_s = time.monotonic()
