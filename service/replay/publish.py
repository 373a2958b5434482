"""`wayfi publish`: puts a recording on Zenoh, as a robot would."""

import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import zenoh

from wayfi.backend.errors import WayfiError
from wayfi.recordings.bags.opening import open_any_recording
from wayfi.recordings.mcap.blocks import Record
from wayfi.recordings.mcap.recording import Recording
from wayfi.recordings.ros.topics import Channel, Encoding, route
from wayfi.service.config import Config, ZenohConfig
from wayfi.service.replay.found_topics import with_found_topics
from wayfi.service.replay.playback_rate import PlaybackRate
from wayfi.service.transport.publishers import ALIVE
from wayfi.service.transport.subscribers import SYNC
from wayfi.service.transport.zenoh_session import (
    RefusedError,
    UnreachableError,
    key_of,
    open_guest_session,
    open_with_retries,
)

WAIT_S = 10.0
SYNC_S = 60.0
POLL_S = 0.05
ENCODING = {Encoding.CDR: zenoh.Encoding.APPLICATION_CDR, Encoding.JSON: zenoh.Encoding.APPLICATION_JSON}


class PublishError(WayfiError):
    """Nothing to publish, nobody who listens, or a listener that is too slow."""


@dataclass(frozen=True, slots=True)
class PublishSummary:
    """Messages put by topic, the seconds it took, unused topics with the reason, the recording's warnings."""

    messages: dict[str, int]
    seconds: float
    unused: dict[str, str]
    warnings: list[str]


def publish_recording(
    path: Path, config: Config, rate: float | None, progress: Callable[[float], None] = lambda _: None
) -> PublishSummary:
    """Put the sensors' messages of a recording at `rate` times real time (None: as fast as they are received).

    Returns when they have been received; calls `progress` with the share done, 0 to 1. Raises RecordingError,
    ZenohError or PublishError.
    """
    recording = open_any_recording(path)
    config, sought = with_found_topics(config, recording)
    deadline_s = time.monotonic() + WAIT_S
    with ExitStack() as opened:
        session = opened.enter_context(_connect(config.zenoh, deadline_s))
        outlet = _Outlet(session, config, opened)
        outlet.wait_for_listener(deadline_s)
        start_s = time.monotonic()
        playback = PlaybackRate(rate)
        _put_all(recording, outlet, playback, progress)
        outlet.wait_until_received()
        seconds = time.monotonic() - start_s
    if not outlet.messages:
        raise PublishError(f"{path}: nothing that feeds a sensor; see `wayfi inspect`")
    warnings = recording.warnings + sought + playback.warnings
    return PublishSummary(dict(outlet.messages), seconds, outlet.unused, warnings)


def _connect(config: ZenohConfig, deadline_s: float) -> zenoh.Session:
    def may_come(error: UnreachableError) -> bool:
        return not isinstance(error, RefusedError) and time.monotonic() < deadline_s

    try:
        return open_with_retries(lambda: open_guest_session(config), may_come)
    except RefusedError:
        raise
    except UnreachableError:
        raise _no_listener(config) from None


def _no_listener(config: ZenohConfig) -> PublishError:
    where = ", ".join(config.connect or config.listen)
    return PublishError(f"nobody listens at {where}: start `wayfi run` first, or see zenoh.connect")


def _put_all(
    recording: Recording, outlet: "_Outlet", playback: PlaybackRate, progress: Callable[[float], None]
) -> None:
    total = max(recording.message_count, 1)
    for number, record in enumerate(recording):
        playback.wait_for(record.log_time_ns)
        outlet.put(record)
        if number % 100 == 0:
            progress(number / total)
    progress(1.0)


class _Outlet:
    """Reliable publishers, one for each channel that feeds a sensor.

    `messages` counts what was put, by topic; `unused` are the other topics, with the reason.
    """

    def __init__(self, session: zenoh.Session, config: Config, opened: ExitStack) -> None:
        self._session = session
        self._config = config.zenoh
        self._topics = config.recording.every_topic
        self._opened = opened
        self._publishers: dict[Channel, zenoh.Publisher | None] = {}
        self.messages: Counter[str] = Counter()
        self.unused: dict[str, str] = {}

    def put(self, record: Record) -> None:
        """Put one record, unless its topic feeds no sensor."""
        channel = record.channel
        if channel not in self._publishers:
            self._publishers[channel] = self._declare(channel)
        publisher = self._publishers[channel]
        if publisher is not None:
            publisher.put(record.data)
            self.messages[record.topic] += 1

    def wait_for_listener(self, deadline_s: float) -> None:
        """Wait until a daemon is ready or anybody else subscribes. Raises PublishError."""
        publishers = [self._publisher(topic, Encoding.CDR) for names in self._topics.values() for topic in names]
        while not (self._daemon_is_ready() or any(map(has_subscriber, publishers))):
            if time.monotonic() > deadline_s:
                raise _no_listener(self._config)
            time.sleep(POLL_S)

    def wait_until_received(self) -> None:
        """Wait until every listener that answers `wayfi/sync` has received what was put. Raises PublishError."""
        key = key_of(self._config, SYNC)
        for reply in self._session.get(key, target=zenoh.QueryTarget.ALL, timeout=SYNC_S):
            if reply.ok is None:
                raise PublishError(f"not everything was received within {SYNC_S:.0f} s: is the listener too slow?")

    def _daemon_is_ready(self) -> bool:
        replies = self._session.liveliness().get(key_of(self._config, ALIVE), timeout=1.0)
        return any(reply.ok is not None for reply in replies)

    def _declare(self, channel: Channel) -> zenoh.Publisher | None:
        found = route(*channel, self._topics)
        if found.encoding is None:
            self.unused[channel[0]] = found.why
            return None
        return self._publisher(channel[0], found.encoding)

    def _publisher(self, topic: str, encoding: Encoding) -> zenoh.Publisher:
        publisher = self._session.declare_publisher(
            key_of(self._config, topic),
            encoding=ENCODING[encoding],
            congestion_control=zenoh.CongestionControl.BLOCK,
            reliability=zenoh.Reliability.RELIABLE,
        )
        return self._opened.enter_context(publisher)


def has_subscriber(publisher: zenoh.Publisher) -> bool:
    """Whether anybody subscribes to what `publisher` puts."""
    return bool(publisher.matching_status.matching)  # type: ignore[attr-defined]  # in the stubs it is a bool
