"""A queue in the order of arrival, whose messages are bounded for each sensor and whose drops are counted."""

import threading
import time
from collections import Counter, OrderedDict, deque
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, TypeVar

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import ZenohConfig

MIB = 1 << 20
QUEUE_BYTES = 64 * MIB  # of a sensor: two clouds of the largest size, or some seconds of smaller ones
WIFI_MESSAGES = 200  # phones send one in two seconds: over a minute of five of them
TF_STATIC_MESSAGES = 100  # each is sent once, when its publisher starts: more than a robot has frames
TF_MESSAGES = 12_000  # 60 s at 200 Hz, as of odometry, which may be in it

Item = TypeVar("Item")


class QueueDrop(StrEnum):
    """Why a message did not reach the pipeline."""

    QUEUE_FULL = "queue_full"
    TOO_LARGE = "too_large"
    STOPPED = "stopped"
    PAUSED = "paused"


@dataclass(frozen=True, slots=True)
class Received:
    """One message as it was received; `received_s` is the time of its callback on the monotonic clock."""

    sensor: Sensor
    encoding: Encoding
    data: bytes
    received_s: float


@dataclass(frozen=True, slots=True)
class QueueLimit:
    """How many messages of a sensor may wait, and how large each may be; together at most `QUEUE_BYTES`."""

    messages: int
    message_bytes: int


def limits_of(config: ZenohConfig) -> dict[Sensor, QueueLimit]:
    """The daemon's limits; a message may be about twice as large as the largest that the codec accepts."""
    return {
        Sensor.ODOM: QueueLimit(config.odom_queue, MIB // 16),
        Sensor.SCAN: QueueLimit(config.scan_queue, 4 * MIB),
        Sensor.POINTS: QueueLimit(config.scan_queue, 32 * MIB),
        Sensor.WIFI: QueueLimit(WIFI_MESSAGES, 4 * MIB),
        Sensor.TF_STATIC: QueueLimit(TF_STATIC_MESSAGES, MIB),
        Sensor.TF: QueueLimit(TF_MESSAGES, MIB),
    }


class MessageQueue(Generic[Item]):
    """Holds messages (`Received`) and any other items in the order of arrival; several threads fill it, one empties it.

    Where a sensor's messages exceed its limit, its oldest message is dropped. Other items are never dropped. Drops are
    counted by sensor and reason.
    """

    def __init__(self, limits: Mapping[Sensor, QueueLimit]) -> None:
        self._limits = limits
        self._items: OrderedDict[int, Item] = OrderedDict()
        self._numbers: dict[Sensor, deque[int]] = {sensor: deque() for sensor in limits}
        self._bytes: Counter[Sensor] = Counter()
        self._received: Counter[Sensor] = Counter()
        self._dropped: dict[Sensor, Counter[str]] = {sensor: Counter() for sensor in limits}
        self._next_number = 0
        self._woken = False
        self._changed = threading.Condition()

    def put(self, item: Item) -> None:
        """Append an item; a message may drop older ones of its sensor."""
        with self._changed:
            self._items[self._next_number] = item
            if isinstance(item, Received):
                self._received[item.sensor] += 1
                self._bytes[item.sensor] += len(item.data)
                self._numbers[item.sensor].append(self._next_number)
                self._drop_excess(item.sensor)
            self._next_number += 1
            self._changed.notify()

    def refuse(self, sensor: Sensor, reason: QueueDrop) -> None:
        """Count a message that was received and is not put."""
        with self._changed:
            self._received[sensor] += 1
            self._dropped[sensor][reason] += 1

    def fits(self, sensor: Sensor, size_bytes: int) -> bool:
        """Whether a message is small enough to be put."""
        return size_bytes <= self._limits[sensor].message_bytes

    def has_room(self, sensor: Sensor) -> bool:
        """Whether one more message of a sensor drops none."""
        with self._changed:
            return len(self._numbers[sensor]) < self._limits[sensor].messages and self._bytes[sensor] < QUEUE_BYTES

    def pop(self, timeout_s: float) -> Item | None:
        """Remove and return the oldest item; None where none arrives within `timeout_s`, or `wake` is called."""
        with self._changed:
            if not self._items and timeout_s > 0 and not self._woken:
                self._changed.wait(timeout_s)
            self._woken = False
            return self._remove(next(iter(self._items))) if self._items else None

    def wake(self) -> None:
        """End the present or next wait for an item; callable from any thread."""
        with self._changed:
            self._woken = True
            self._changed.notify()

    def wait(self, timeout_s: float) -> None:
        """Wait for `wake`, whatever is put meanwhile."""
        deadline_s = time.monotonic() + timeout_s
        with self._changed:
            while not self._woken and (left_s := deadline_s - time.monotonic()) > 0:
                self._changed.wait(left_s)
            self._woken = False

    def drop_messages(self) -> None:
        """Drop all messages at shutdown, counted as STOPPED; other items stay."""
        with self._changed:
            for sensor, numbers in self._numbers.items():
                while numbers:
                    self._drop_oldest(sensor, QueueDrop.STOPPED)

    def __len__(self) -> int:
        with self._changed:
            return len(self._items)

    def depths(self) -> dict[Sensor, int]:
        """How many messages of each sensor wait."""
        with self._changed:
            return {sensor: len(numbers) for sensor, numbers in self._numbers.items()}

    def received(self) -> dict[Sensor, int]:
        """How many messages of each sensor were received, the dropped ones included."""
        with self._changed:
            return {sensor: self._received[sensor] for sensor in self._numbers}

    def dropped(self) -> dict[Sensor, dict[str, int]]:
        """How many messages of each sensor were dropped, by reason."""
        with self._changed:
            return {sensor: dict(reasons) for sensor, reasons in self._dropped.items() if reasons}

    def _drop_excess(self, sensor: Sensor) -> None:
        numbers, most = self._numbers[sensor], self._limits[sensor].messages
        while len(numbers) > most or self._bytes[sensor] > QUEUE_BYTES:
            self._drop_oldest(sensor, QueueDrop.QUEUE_FULL)

    def _drop_oldest(self, sensor: Sensor, reason: QueueDrop) -> None:
        self._remove(self._numbers[sensor][0])
        self._dropped[sensor][reason] += 1

    def _remove(self, number: int) -> Item:
        """Remove an item; a message has to be the oldest of its sensor."""
        item = self._items.pop(number)
        if isinstance(item, Received):
            self._numbers[item.sensor].popleft()
            self._bytes[item.sensor] -= len(item.data)
        return item
