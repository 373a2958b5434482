"""What has come in and waits for the pipeline: one bounded queue a sensor, taken in the order of arrival."""

import threading
import time
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import ZenohConfig

QUEUE_BYTES = 64 << 20
MIB = 1 << 20


class QueueDrop(StrEnum):
    """Why a message never came to the pipeline."""

    QUEUE_FULL = "queue_full"
    TOO_LARGE = "too_large"
    STOPPED = "stopped"
    PAUSED = "paused"


@dataclass(frozen=True, slots=True)
class Received:
    """One message as it came; `received_s` is the moment of its callback on the monotonic clock."""

    sensor: Sensor
    encoding: Encoding
    data: bytes
    received_s: float


@dataclass(frozen=True, slots=True)
class QueueLimit:
    """How many messages of a sensor may wait, and how large one may be; all of them together, `QUEUE_BYTES`."""

    messages: int
    message_bytes: int


def limits_of(config: ZenohConfig) -> dict[Sensor, QueueLimit]:
    """The daemon's limits; each message's is some twice that of the largest one that the codec takes."""
    return {
        Sensor.ODOM: QueueLimit(config.odom_queue, MIB // 16),
        Sensor.SCAN: QueueLimit(config.scan_queue, 4 * MIB),
        Sensor.POINTS: QueueLimit(config.scan_queue, 32 * MIB),
        Sensor.WIFI: QueueLimit(200, 4 * MIB),
        Sensor.TF_STATIC: QueueLimit(100, MIB),
    }


class Queues:
    """Written by Zenoh's threads, read by one other; where a queue is full the oldest message makes room."""

    def __init__(self, limits: Mapping[Sensor, QueueLimit]) -> None:
        self._limits = limits
        self._waiting: dict[Sensor, deque[tuple[int, Received]]] = {sensor: deque() for sensor in limits}
        self._bytes: Counter[Sensor] = Counter()
        self._received: Counter[Sensor] = Counter()
        self._dropped: dict[Sensor, Counter[str]] = {sensor: Counter() for sensor in limits}
        self._sequence = 0
        self._woken = False
        self._changed = threading.Condition()

    def put(self, sensor: Sensor, encoding: Encoding, data: bytes) -> None:
        """Queue one message, as received now."""
        received = Received(sensor, encoding, data, time.monotonic())
        with self._changed:
            self._received[sensor] += 1
            self._sequence += 1
            self._waiting[sensor].append((self._sequence, received))
            self._bytes[sensor] += len(data)
            while self._over(sensor):
                self._pop(sensor)
                self._dropped[sensor][QueueDrop.QUEUE_FULL] += 1
            self._changed.notify()

    def refuse(self, sensor: Sensor, reason: QueueDrop) -> None:
        """Count a message that is not queued."""
        with self._changed:
            self._received[sensor] += 1
            self._dropped[sensor][reason] += 1

    def fits(self, sensor: Sensor, size_bytes: int) -> bool:
        """Whether a message is small enough to be queued."""
        return size_bytes <= self._limits[sensor].message_bytes

    def take(self, timeout_s: float) -> Received | None:
        """The message that has waited longest; None where none comes in time, or `wake` is called."""
        with self._changed:
            first = self._first()
            if first is None and timeout_s > 0 and not self._woken:
                self._changed.wait(timeout_s)
                first = self._first()
            self._woken = False
            return None if first is None else self._pop(first)

    def wake(self) -> None:
        """Let whoever waits look for something else; from any thread."""
        with self._changed:
            self._woken = True
            self._changed.notify()

    def wait(self, timeout_s: float) -> None:
        """Wait to be woken, whatever comes in."""
        deadline_s = time.monotonic() + timeout_s
        with self._changed:
            while not self._woken and (left_s := deadline_s - time.monotonic()) > 0:
                self._changed.wait(left_s)
            self._woken = False

    def clear(self) -> None:
        """Drop what still waits, because the end has come."""
        with self._changed:
            for sensor, waiting in self._waiting.items():
                if waiting:
                    self._dropped[sensor][QueueDrop.STOPPED] += len(waiting)
                waiting.clear()
            self._bytes.clear()

    def depths(self) -> dict[Sensor, int]:
        """How many messages of each sensor wait."""
        with self._changed:
            return {sensor: len(waiting) for sensor, waiting in self._waiting.items()}

    def received(self) -> dict[Sensor, int]:
        """How many messages of each sensor came, the dropped ones included."""
        with self._changed:
            return {sensor: self._received[sensor] for sensor in self._waiting}

    def dropped(self) -> dict[Sensor, dict[str, int]]:
        """How many messages of each sensor were dropped for which reason."""
        with self._changed:
            return {sensor: dict(reasons) for sensor, reasons in self._dropped.items() if reasons}

    def _first(self) -> Sensor | None:
        heads = [(waiting[0][0], sensor) for sensor, waiting in self._waiting.items() if waiting]
        return min(heads)[1] if heads else None

    def _over(self, sensor: Sensor) -> bool:
        return len(self._waiting[sensor]) > self._limits[sensor].messages or self._bytes[sensor] > QUEUE_BYTES

    def _pop(self, sensor: Sensor) -> Received:
        received = self._waiting[sensor].popleft()[1]
        self._bytes[sensor] -= len(received.data)
        return received
