"""Zenoh in: callbacks that do no more than put bytes into bounded queues."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from types import TracebackType
from typing import Any, Self

import zenoh

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.topics import Encoding
from wayfi.service.config import ZenohConfig
from wayfi.service.queues import QueueDrop, Queues
from wayfi.service.zenoh_session import key_of

SYNC = "wayfi/sync"


class Subscribers:
    """Subscribes to the `topics` of the sensors and fills `queues`; a context manager.

    The callbacks run in Zenoh's own receiving threads: only so do messages of one sender keep their order over all
    topics, and a sender that puts with congestion control BLOCK is slowed down rather than cut off. A query of
    `wayfi/sync` is answered when all that its asker put before has been received. Raises ZenohError.
    """

    def __init__(
        self, session: zenoh.Session, config: ZenohConfig, topics: Mapping[Sensor, str], queues: Queues
    ) -> None:
        self._queues = queues
        with ExitStack() as opened:
            for sensor, topic in topics.items():
                key = key_of(config, topic)
                opened.enter_context(session.declare_subscriber(key, _direct(self._receiver(sensor))))
            opened.enter_context(session.declare_queryable(key_of(config, SYNC), _direct(_answer)))
            self._opened = opened.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._opened.close()

    def _receiver(self, sensor: Sensor) -> Callable[[zenoh.Sample], None]:
        def receive(sample: zenoh.Sample) -> None:
            if sample.kind != zenoh.SampleKind.PUT:
                return
            if not self._queues.fits(sensor, len(sample.payload)):
                self._queues.refuse(sensor, QueueDrop.TOO_LARGE)
                return
            is_json = str(sample.encoding).startswith("application/json")
            self._queues.put(sensor, Encoding.JSON if is_json else Encoding.CDR, sample.payload.to_bytes())

        return receive


def _answer(query: zenoh.Query) -> None:
    with query:
        query.reply(query.key_expr, b"")


def _direct(callback: Callable[[Any], object]) -> Any:  # noqa: ANN401 - Zenoh's stubs do not let it pass as a handler
    return zenoh.handlers.Callback(callback, indirect=False)
