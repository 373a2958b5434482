"""A queue in the order of arrival, whose messages are bounded for each topic and whose drops are counted."""

import threading
import time
from collections import Counter, OrderedDict, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Generic, TypeVar

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import ZenohConfig

MIB = 1 << 20
QUEUE_BYTES = 64 * MIB  # of a topic: two clouds of the largest size, or some seconds of smaller ones
WIFI_MESSAGES = 200  # phones send one in two seconds: over a minute of five of them
TF_STATIC_MESSAGES = 100  # each is sent once, when its publisher starts: more than a robot has frames
FIX_MESSAGES = 600  # 20 s of a camera that sees a fiducial
INITIAL_POSES = 20  # each is a click of a person
TF_MESSAGES = 12_000  # 60 s at 200 Hz, as of odometry, which may be in it
EVENLY = 1.25  # times the shortest gap that a drop leaves: they pass for equal; from 1.5 on two in a row would go

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
    topic: str
    encoding: Encoding
    data: bytes
    received_s: float


@dataclass(frozen=True, slots=True)
class QueueLimit:
    """How many messages of a topic may wait, and how large each may be; together at most `QUEUE_BYTES`."""

    messages: int
    message_bytes: int


def limits_of(config: ZenohConfig, topics: Mapping[Sensor, Sequence[str]]) -> dict[str, QueueLimit]:
    """The daemon's limits of each topic; a message may be about twice as large as the largest that is decoded."""
    limits = {
        Sensor.ODOM: QueueLimit(config.odom_queue, MIB // 16),
        Sensor.SCAN: QueueLimit(config.scan_queue, 4 * MIB),
        Sensor.POINTS: QueueLimit(config.scan_queue, 32 * MIB),
        Sensor.WIFI: QueueLimit(WIFI_MESSAGES, 4 * MIB),
        Sensor.TF_STATIC: QueueLimit(TF_STATIC_MESSAGES, MIB),
        Sensor.TF: QueueLimit(TF_MESSAGES, MIB),
        Sensor.FIX: QueueLimit(FIX_MESSAGES, MIB // 16),
        Sensor.INITIAL_POSE: QueueLimit(INITIAL_POSES, MIB // 16),
    }
    return {topic: limits[sensor] for sensor, names in topics.items() for topic in names}


class MessageQueue(Generic[Item]):
    """Holds messages (`Received`) and any other items in the order of arrival; several threads fill it, one empties it.

    Where a topic's messages exceed its limit, they are thinned evenly: a laser that leads comes over small gaps, and
    not over a long one. Other items are never dropped. Drops are counted by topic and reason.
    """

    def __init__(self, limits: Mapping[str, QueueLimit]) -> None:
        self._limits = limits
        self._items: OrderedDict[int, Item] = OrderedDict()
        self._numbers: dict[str, deque[int]] = {topic: deque() for topic in limits}
        self._bytes: Counter[str] = Counter()
        self._received: Counter[str] = Counter()
        self._dropped: dict[str, Counter[str]] = {topic: Counter() for topic in limits}
        self._next_number = 0
        self._woken = False
        self._changed = threading.Condition()

    def put(self, item: Item) -> None:
        """Append an item; a message may drop others of its topic."""
        with self._changed:
            self._items[self._next_number] = item
            if isinstance(item, Received):
                self._received[item.topic] += 1
                self._bytes[item.topic] += len(item.data)
                self._numbers[item.topic].append(self._next_number)
                self._drop_excess(item.topic)
            self._next_number += 1
            self._changed.notify()

    def refuse(self, topic: str, reason: QueueDrop) -> None:
        """Count a message that was received and is not put."""
        with self._changed:
            self._received[topic] += 1
            self._dropped[topic][reason] += 1

    def fits(self, topic: str, size_bytes: int) -> bool:
        """Whether a message is small enough to be put."""
        return size_bytes <= self._limits[topic].message_bytes

    def has_room(self, topic: str) -> bool:
        """Whether one more message of a topic drops none."""
        with self._changed:
            return len(self._numbers[topic]) < self._limits[topic].messages and self._bytes[topic] < QUEUE_BYTES

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
            for topic, numbers in self._numbers.items():
                while numbers:
                    self._drop(numbers[0], topic, QueueDrop.STOPPED)

    def __len__(self) -> int:
        with self._changed:
            return len(self._items)

    def depths(self) -> dict[str, int]:
        """How many messages of each topic wait."""
        with self._changed:
            return {topic: len(numbers) for topic, numbers in self._numbers.items()}

    def received(self) -> dict[str, int]:
        """How many messages of each topic were received, the dropped ones included."""
        with self._changed:
            return {topic: self._received[topic] for topic in self._numbers}

    def dropped(self) -> dict[str, dict[str, int]]:
        """How many messages of each topic were dropped, by reason."""
        with self._changed:
            return {topic: dict(reasons) for topic, reasons in self._dropped.items() if reasons}

    def _drop_excess(self, topic: str) -> None:
        numbers, most = self._numbers[topic], self._limits[topic].messages
        while len(numbers) > most or self._bytes[topic] > QUEUE_BYTES:
            for number in _dispensable(numbers):
                self._drop(number, topic, QueueDrop.QUEUE_FULL)

    def _drop(self, number: int, topic: str, reason: QueueDrop) -> None:
        self._remove(number)
        self._dropped[topic][reason] += 1

    def _remove(self, number: int) -> Item:
        item = self._items.pop(number)
        if isinstance(item, Received):
            self._numbers[item.topic].remove(number)
            self._bytes[item.topic] -= len(item.data)
        return item


def _dispensable(numbers: Sequence[int]) -> list[int]:
    """Which of a topic's messages to drop, one at least: those whose neighbours came nearest to each other.

    The oldest and the newest stay, but where there is nothing between them.
    """
    if len(numbers) < 3:
        return [numbers[0]]
    ordered, dropped = list(numbers), []
    before, near = ordered[0], EVENLY * min(b - a for a, b in zip(ordered, ordered[2:], strict=False))
    for number, after in pairwise(ordered[1:]):
        if after - before <= near:
            dropped.append(number)
        else:
            before = number
    return dropped
