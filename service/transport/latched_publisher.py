"""A publisher whose last message is latched for late subscribers."""

from contextlib import ExitStack

import zenoh
from zenoh.ext import CacheConfig, MissDetectionConfig, declare_advanced_publisher

from wayfi.recordings.closing import Closing

HEARTBEAT_S = 0.5  # rmw_zenoh's own


class LatchedPublisher(Closing):
    """Latches its last message for late subscribers that ask for history, and for queries; a context manager."""

    def __init__(self, session: zenoh.Session, key: str, congestion_control: zenoh.CongestionControl) -> None:
        self._key = key
        self._last: tuple[bytes, bytes | None] | None = None
        with ExitStack() as opened:
            self._publisher = opened.enter_context(
                declare_advanced_publisher(
                    session,
                    key,
                    encoding=zenoh.Encoding.APPLICATION_CDR,
                    congestion_control=congestion_control,
                    priority=zenoh.Priority.DATA_LOW,
                    cache=CacheConfig(max_samples=1),
                    publisher_detection=True,
                    sample_miss_detection=MissDetectionConfig(heartbeat=None, sporadic_heartbeat=HEARTBEAT_S),
                )
            )
            opened.enter_context(session.declare_queryable(key, self._answer))
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Undeclare everything."""
        self._opened.close()

    def put(self, data: bytes, *, attachment: bytes | None = None) -> None:
        """Publish `data` and latch it."""
        self._last = data, attachment
        self._publisher.put(data, attachment=attachment)

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            if self._last is not None:
                data, attachment = self._last
                query.reply(self._key, data, encoding=zenoh.Encoding.APPLICATION_CDR, attachment=attachment)
