"""Zenoh out for ROS 2: what Nav2 has of AMCL and map_server, under the keys of rmw_zenoh or zenoh-bridge-ros2dds."""

import itertools
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import zenoh

from wayfi.recordings.closing import Closing
from wayfi.recordings.ros.messages import DIAGNOSTIC_ARRAY, OCCUPANCY_GRID, POSE_WITH_COVARIANCE, TF_MESSAGE
from wayfi.service.config import ZenohConfig
from wayfi.service.transport.latched_publisher import LatchedPublisher
from wayfi.service.transport.ros_keys import RosTopic, attachment, gid_of, node_token, publisher_token, rmw_key
from wayfi.service.transport.zenoh_session import key_of

POSE = RosTopic("wayfi/pose", POSE_WITH_COVARIANCE, depth=10)
TF = RosTopic("tf", TF_MESSAGE, depth=100)
MAP = RosTopic("map", OCCUPANCY_GRID, depth=1, latched=True)
AMCL_POSE = RosTopic("amcl_pose", POSE_WITH_COVARIANCE, depth=1, latched=True)
DIAGNOSTICS = RosTopic("diagnostics", DIAGNOSTIC_ARRAY, depth=10)

Put = Callable[..., Any]


class RosPublishers(Closing):
    """Publishes to ROS 2 in the convention of `zenoh.ros`; nothing where that is "none". A context manager.

    The bridge's key of the pose is wayfi's own, where it is published already. Raises ZenohError.
    """

    def __init__(self, session: zenoh.Session, config: ZenohConfig) -> None:
        self._session = session
        self._config = config
        self._puts: dict[RosTopic, Put] = {}
        with ExitStack() as opened:
            if config.ros == "bridge":
                self._open_for_bridge(opened)
            elif config.ros == "rmw":
                self._open_for_rmw(opened)
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Undeclare everything."""
        self._opened.close()

    def put(self, topic: RosTopic, data: bytes) -> None:
        """Publish a message, if the convention needs `topic`."""
        if topic in self._puts:
            self._puts[topic](data)

    def _open_for_bridge(self, opened: ExitStack) -> None:
        for topic in (TF, MAP, AMCL_POSE, DIAGNOSTICS):
            self._puts[topic] = self._open(opened, topic, key_of(self._config, topic.name))

    def _open_for_rmw(self, opened: ExitStack) -> None:
        domain, session_id = self._config.ros_domain, str(self._session.info.zid())
        namespace = self._config.prefix.strip("/")
        declare_token = self._session.liveliness().declare_token
        opened.enter_context(declare_token(node_token(domain, session_id, namespace)))
        for number, topic in enumerate((POSE, TF, MAP, AMCL_POSE, DIAGNOSTICS), start=1):
            key = rmw_key(domain, key_of(self._config, topic.name), topic.type_name)
            token = publisher_token(domain, session_id, number, namespace, topic)
            self._puts[topic] = _numbered(self._open(opened, topic, key), gid_of(token))
            opened.enter_context(declare_token(token))

    def _open(self, opened: ExitStack, topic: RosTopic, key: str) -> Put:
        if topic.latched:
            patience = zenoh.CongestionControl.BLOCK if topic is MAP else zenoh.CongestionControl.DROP
            return opened.enter_context(LatchedPublisher(self._session, key, patience)).put
        urgent, cdr = zenoh.Priority.INTERACTIVE_HIGH, zenoh.Encoding.APPLICATION_CDR
        return opened.enter_context(self._session.declare_publisher(key, encoding=cdr, priority=urgent)).put


def _numbered(put: Put, gid: bytes) -> Put:
    """`put` with the numbered attachment that rmw_zenoh expects of each message."""
    numbers = itertools.count(1)
    return lambda data: put(data, attachment=attachment(next(numbers), time.time_ns(), gid))
