"""Zenoh out: pose and transform as they are known, the map kept for those who come late, the status."""

from contextlib import ExitStack
from types import TracebackType
from typing import Self

import zenoh

from wayfi.backend.grid_map import MapConfig
from wayfi.frontends.events import Event, GridRedrawn, PosePublished
from wayfi.recordings.codec_error import CodecError
from wayfi.service.config import ZenohConfig
from wayfi.service.kept_publisher import KeptPublisher
from wayfi.service.output_messages import Status, map_message, pose_message, status_message, transform_message
from wayfi.service.ros_publishers import MAP, POSE, TF, RosPublishers
from wayfi.service.zenoh_session import key_of

CDR = zenoh.Encoding.APPLICATION_CDR
ALIVE = "wayfi/alive"


class Publishers:
    """Publishes events; a context manager. Nothing here waits for a subscriber that is slow, but for the map's.

    `unpublished` counts the poses whose stamp no ROS time can hold.
    """

    def __init__(self, session: zenoh.Session, config: ZenohConfig, map_config: MapConfig) -> None:
        self._session = session
        self._config = config
        self._map_config = map_config
        self.unpublished = 0
        urgent = zenoh.Priority.INTERACTIVE_HIGH
        with ExitStack() as opened:
            enter = opened.enter_context
            self._pose = enter(session.declare_publisher(self._key("pose"), encoding=CDR, priority=urgent))
            self._tf = enter(session.declare_publisher(self._key("tf"), encoding=CDR, priority=urgent))
            self._status = enter(KeptPublisher(session, self._key("status"), zenoh.CongestionControl.DROP))
            self._map = enter(KeptPublisher(session, self._key("map"), zenoh.CongestionControl.BLOCK))
            self._ros = enter(RosPublishers(session, config))
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

    def publish(self, event: Event) -> None:
        """Publish an event, if it is one that is published."""
        match event:
            case PosePublished():
                self._publish_pose(event)
            case GridRedrawn():
                self._publish_map(map_message(event, self._map_config))

    def publish_status(self, stamp_ns: int, status: Status) -> None:
        """Publish the status, as of the wall clock's `stamp_ns`."""
        self._status.put(status_message(stamp_ns, status))

    def _publish_pose(self, event: PosePublished) -> None:
        try:
            pose, transform = pose_message(event), transform_message(event)
        except CodecError:
            self.unpublished += 1
            return
        self._pose.put(pose)
        self._tf.put(transform)
        self._ros.put(POSE, pose)
        self._ros.put(TF, transform)

    def _publish_map(self, data: bytes) -> None:
        self._map.put(data)
        self._ros.put(MAP, data)

    def _key(self, name: str) -> str:
        return key_of(self._config, f"wayfi/{name}")
