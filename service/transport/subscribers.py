"""Zenoh in: callbacks that only put what they receive into a bounded queue."""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any

import zenoh
from zenoh.ext import AdvancedSubscriber, HistoryConfig, declare_advanced_subscriber

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.closing import Closing
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import ZenohConfig
from wayfi.service.transport.message_queue import MessageQueue, QueueDrop, Received
from wayfi.service.transport.ros_keys import rmw_key_expression
from wayfi.service.transport.zenoh_session import key_of

SYNC = "wayfi/sync"
INITIAL_POSE = "wayfi/initialpose"
LATCHED_SAMPLES = 1  # of each publisher: a message of static transforms holds all of its broadcaster's


class Subscribers(Closing):
    """Subscribes to the `topics` of the sensors and fills `inbox`; a context manager.

    A topic's key is also that of zenoh-bridge-ros2dds, with `zenoh.prefix` as its namespace. The keys of rmw_zenoh are
    longer, so that no message is received twice; their attachments hold nothing that is needed and are not read. An
    initial pose is received on `wayfi/initialpose` as well.

    The callbacks run in Zenoh's receiving threads: messages of one sender keep their order over all topics, and a
    sender with congestion control BLOCK is slowed down rather than cut off. A query of `wayfi/sync` is answered when
    all that the same session put before has been received. Raises ZenohError.
    """

    def __init__(
        self,
        session: zenoh.Session,
        config: ZenohConfig,
        topics: Mapping[Sensor, Sequence[str]],
        inbox: MessageQueue[Received],
    ) -> None:
        self._inbox = inbox
        with ExitStack() as opened:
            for sensor, topic in ((sensor, topic) for sensor, names in topics.items() for topic in names):
                for keys in _keys(config, sensor, topic):
                    opened.enter_context(_subscribe(session, keys, sensor, _direct(self._receiver(sensor, topic))))
            opened.enter_context(session.declare_queryable(key_of(config, SYNC), _direct(_answer)))
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Undeclare everything."""
        self._opened.close()

    def _receiver(self, sensor: Sensor, topic: str) -> Callable[[zenoh.Sample], None]:
        def receive(sample: zenoh.Sample) -> None:
            if sample.kind != zenoh.SampleKind.PUT:
                return
            if not self._inbox.fits(topic, len(sample.payload)):
                self._inbox.refuse(topic, QueueDrop.TOO_LARGE)
                return
            encoding = Encoding.JSON if str(sample.encoding).startswith("application/json") else Encoding.CDR
            self._inbox.put(Received(sensor, topic, encoding, sample.payload.to_bytes(), time.monotonic()))

        return receive


def _keys(config: ZenohConfig, sensor: Sensor, topic: str) -> list[str]:
    """The keys on which the messages of a sensor's topic are received."""
    key = key_of(config, topic)
    own = [key_of(config, INITIAL_POSE)] if sensor is Sensor.INITIAL_POSE else []
    return [key, rmw_key_expression(key, TYPE_OF_SENSOR[sensor]), *own]


def _subscribe(
    session: zenoh.Session,
    keys: str,
    sensor: Sensor,
    handler: Any,  # noqa: ANN401 - see _direct
) -> "zenoh.Subscriber[None] | AdvancedSubscriber[None]":
    """A subscriber; for static transforms, which are latched, one that asks for the publishers' history."""
    if sensor is Sensor.TF:  # without the transform from map to odom that this session publishes
        return session.declare_subscriber(keys, handler, allowed_origin=zenoh.Locality.REMOTE)
    if sensor is not Sensor.TF_STATIC:
        return session.declare_subscriber(keys, handler)
    history = HistoryConfig(detect_late_publishers=True, max_samples=LATCHED_SAMPLES)
    return declare_advanced_subscriber(session, keys, handler, history=history)


def _answer(query: zenoh.Query) -> None:
    with query:
        query.reply(query.key_expr, b"")


def _direct(callback: Callable[[Any], object]) -> Any:  # noqa: ANN401 - Zenoh's stubs do not let it pass as a handler
    return zenoh.handlers.Callback(callback, indirect=False)
