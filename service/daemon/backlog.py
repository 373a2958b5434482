"""What the estimation has still to be fed: messages and marks in their order, bounded for each sensor."""

import threading
from collections import Counter, OrderedDict, deque
from collections.abc import Mapping

from wayfi.frontends.measurements import Sensor
from wayfi.service.daemon.estimator_messages import Request
from wayfi.service.drive.control_records import ControlRecord
from wayfi.service.transport.queues import QUEUE_BYTES, QueueDrop, QueueLimit, Received

Item = Received | ControlRecord | Request


class Backlog:
    """Filled by one thread, taken from by another. Where a sensor has no more room its oldest message is dropped.

    Odometry is not to be put where it has no room: every message that a pose was published for stays.
    """

    def __init__(self, limits: Mapping[Sensor, QueueLimit]) -> None:
        self._limits = limits
        self._items: OrderedDict[int, Item] = OrderedDict()
        self._of: dict[Sensor, deque[int]] = {sensor: deque() for sensor in limits}
        self._bytes: Counter[Sensor] = Counter()
        self._dropped: dict[Sensor, Counter[str]] = {sensor: Counter() for sensor in limits}
        self._sequence = 0
        self._changed = threading.Condition()

    def has_room(self, sensor: Sensor) -> bool:
        """Whether one more message of a sensor drops none."""
        with self._changed:
            return len(self._of[sensor]) < self._limits[sensor].messages and self._bytes[sensor] < QUEUE_BYTES

    def put(self, item: Item) -> None:
        """Add a message, a mark or a request."""
        with self._changed:
            self._sequence += 1
            self._items[self._sequence] = item
            if isinstance(item, Received):
                self._count(item)
            self._changed.notify()

    def refuse(self, sensor: Sensor, reason: QueueDrop) -> None:
        """Count a message that was not put."""
        with self._changed:
            self._dropped[sensor][reason] += 1

    def take(self, timeout_s: float) -> Item | None:
        """The item that has waited longest; None where none comes in time."""
        with self._changed:
            if not self._items:
                self._changed.wait(timeout_s)
            if not self._items:
                return None
            _, item = self._items.popitem(last=False)
            if isinstance(item, Received):
                self._of[item.sensor].popleft()
                self._bytes[item.sensor] -= len(item.data)
            return item

    def drop_messages(self) -> None:
        """Drop the messages that wait, because the end has come; marks and requests stay."""
        with self._changed:
            for sensor, waiting in self._of.items():
                while waiting:
                    self._drop_oldest(sensor, QueueDrop.STOPPED)

    @property
    def waiting(self) -> int:
        """How many items wait."""
        with self._changed:
            return len(self._items)

    def depths(self) -> dict[Sensor, int]:
        """How many messages of each sensor wait."""
        with self._changed:
            return {sensor: len(waiting) for sensor, waiting in self._of.items()}

    def dropped(self) -> dict[Sensor, dict[str, int]]:
        """How many messages of each sensor were dropped for which reason."""
        with self._changed:
            return {sensor: dict(reasons) for sensor, reasons in self._dropped.items() if reasons}

    def _count(self, message: Received) -> None:
        sensor, limit = message.sensor, self._limits[message.sensor]
        self._of[sensor].append(self._sequence)
        self._bytes[sensor] += len(message.data)
        while len(self._of[sensor]) > limit.messages or self._bytes[sensor] > QUEUE_BYTES:
            self._drop_oldest(sensor, QueueDrop.QUEUE_FULL)

    def _drop_oldest(self, sensor: Sensor, reason: QueueDrop) -> None:
        item = self._items.pop(self._of[sensor].popleft())
        assert isinstance(item, Received)
        self._bytes[sensor] -= len(item.data)
        self._dropped[sensor][reason] += 1
