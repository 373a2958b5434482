"""Zenoh out: pose and transform as they are known, the map kept for those who come late, the status."""

from contextlib import ExitStack
from types import TracebackType
from typing import Self

import zenoh
from zenoh.ext import CacheConfig, declare_advanced_publisher

from wayfi.frontends.events import PosePublished
from wayfi.recordings.codec_error import CodecError
from wayfi.service.config import ZenohConfig
from wayfi.service.output_messages import Status, pose_message, status_message, transform_message
from wayfi.service.zenoh_session import key_of

CDR = zenoh.Encoding.APPLICATION_CDR
ALIVE = "wayfi/alive"


class Publishers:
    """Publishes events; a context manager. Nothing here waits for a subscriber that is slow, but for the map's.

    `unpublished` counts the poses whose stamp no ROS time can hold.
    """

    def __init__(self, session: zenoh.Session, config: ZenohConfig) -> None:
        self._session = session
        self._config = config
        self.unpublished = 0
        urgent = zenoh.Priority.INTERACTIVE_HIGH
        with ExitStack() as opened:
            enter = opened.enter_context
            self._pose = enter(session.declare_publisher(self._key("pose"), encoding=CDR, priority=urgent))
            self._tf = enter(session.declare_publisher(self._key("tf"), encoding=CDR, priority=urgent))
            self._status = enter(_Kept(session, self._key("status"), zenoh.CongestionControl.DROP))
            self._map = enter(_Kept(session, self._key("map"), zenoh.CongestionControl.BLOCK))
            self._opened = opened.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._opened.close()

    def announce(self) -> zenoh.LivelinessToken:
        """The word that all is ready; it holds as long as the token that is returned, a context manager."""
        return self._session.liveliness().declare_token(key_of(self._config, ALIVE))

    def publish_map(self, data: bytes) -> None:
        """Publish the map, an OccupancyGrid's bytes."""
        self._map.put(data)

    def publish_status(self, stamp_ns: int, status: Status) -> None:
        """Publish the status, as of the wall clock's `stamp_ns`."""
        self._status.put(status_message(stamp_ns, status))

    def publish_pose(self, event: PosePublished) -> None:
        """Publish a pose and the transform that goes with it."""
        try:
            self._pose.put(pose_message(event))
            self._tf.put(transform_message(event))
        except CodecError:
            self.unpublished += 1

    def _key(self, name: str) -> str:
        return key_of(self._config, f"wayfi/{name}")


class _Kept:
    """A publisher whose last message is kept: for subscribers that ask for history, and as the answer to a query."""

    def __init__(self, session: zenoh.Session, key: str, congestion_control: zenoh.CongestionControl) -> None:
        self._key = key
        self._last: bytes | None = None
        with ExitStack() as opened:
            self._publisher = opened.enter_context(
                declare_advanced_publisher(
                    session,
                    key,
                    encoding=CDR,
                    congestion_control=congestion_control,
                    priority=zenoh.Priority.DATA_LOW,
                    cache=CacheConfig(max_samples=1),
                    publisher_detection=True,
                )
            )
            opened.enter_context(session.declare_queryable(key, self._answer))
            self._opened = opened.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._opened.close()

    def put(self, data: bytes) -> None:
        """Publish `data` and keep it in the place of what was kept."""
        self._last = data
        self._publisher.put(data)

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            if self._last is not None:
                query.reply(self._key, self._last, encoding=CDR)
