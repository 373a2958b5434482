"""What waits in a queue: bounded for each sensor, in the order of arrival, every drop counted."""

import threading
import time
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.transport.message_queue import QUEUE_BYTES, MessageQueue, QueueDrop, QueueLimit, Received

LIMITS = dict.fromkeys(Sensor, QueueLimit(messages=5, message_bytes=100))
ARRIVALS = st.lists(st.sampled_from([*Sensor, None]))  # None: an item that is no message

Queue = MessageQueue[Received | int]


def message(sensor: Sensor, data: bytes) -> Received:
    return Received(sensor, sensor, Encoding.CDR, data, 0.0)


def filled(arrivals: list[Sensor | None]) -> Queue:
    queue = Queue(LIMITS)
    for number, sensor in enumerate(arrivals):
        queue.put(message(sensor, str(number).encode()) if sensor else number)
    return queue


def emptied(queue: Queue) -> list[int]:
    out = []
    while (item := queue.pop(0.0)) is not None:
        out.append(int(item.data) if isinstance(item, Received) else item)
    return out


@settings(deadline=None)
@given(ARRIVALS)
def test_the_ends_of_each_sensor_and_all_other_items_come_out_in_the_order_of_arrival(
    arrivals: list[Sensor | None],
) -> None:
    out = emptied(filled(arrivals))
    assert out == sorted(set(out))
    assert {i for i, sensor in enumerate(arrivals) if sensor is None} <= set(out)
    for sensor in Sensor:
        came = [i for i, s in enumerate(arrivals) if s is sensor]
        left = [i for i in out if arrivals[i] is sensor]
        assert left[:1] == came[:1]
        assert left[-1:] == came[-1:]
        assert len(left) == len(came) if len(came) <= 5 else 3 <= len(left) <= 5


@pytest.mark.parametrize("taken", [0, 3, 9])
def test_a_topic_of_which_too_few_are_taken_is_thinned_evenly(taken: int) -> None:
    """A laser that leads comes over a gap of some scans; the oldest ones, dropped at once, were seconds of them."""
    most, came = 100, 1000
    queue, out = Queue({Sensor.SCAN: QueueLimit(most, 100)}), []
    for number in range(came):
        queue.put(message(Sensor.SCAN, str(number).encode()))
        if number % 10 < taken and isinstance(item := queue.pop(0.0), Received):
            out.append(int(item.data))
    out += emptied(queue)
    assert max(b - a for a, b in pairwise(out)) <= 3 * came / most


@settings(deadline=None)
@given(ARRIVALS, st.integers(0, 10))
def test_every_message_is_popped_or_waits_or_is_counted_as_dropped(arrivals: list[Sensor | None], pops: int) -> None:
    queue = filled(arrivals)
    popped = [queue.pop(0.0) for _ in range(pops)]
    waiting = queue.depths()
    for sensor in Sensor:
        out = sum(isinstance(item, Received) and item.sensor is sensor for item in popped)
        dropped = queue.dropped().get(sensor, {}).get(QueueDrop.QUEUE_FULL, 0)
        assert out + waiting[sensor] + dropped == arrivals.count(sensor) == queue.received()[sensor]
    assert len(queue) == len(emptied(queue))


@settings(deadline=None)
@given(ARRIVALS)
def test_where_there_is_room_one_more_message_drops_none(arrivals: list[Sensor | None]) -> None:
    queue = filled(arrivals)
    for sensor in Sensor:
        before, has_room = queue.dropped().get(sensor, {}), queue.has_room(sensor)
        queue.put(message(sensor, b"0"))
        assert (queue.dropped().get(sensor, {}) == before) == has_room


def test_a_queue_is_bounded_in_bytes() -> None:
    queue = Queue(dict.fromkeys(Sensor, QueueLimit(messages=100, message_bytes=QUEUE_BYTES)))
    for _ in range(4):
        queue.put(message(Sensor.POINTS, bytes(QUEUE_BYTES // 2)))
    assert queue.depths()[Sensor.POINTS] == 2
    assert queue.dropped() == {Sensor.POINTS: {QueueDrop.QUEUE_FULL: 2}}
    assert not queue.has_room(Sensor.POINTS)


def test_messages_dropped_at_shutdown_are_counted_and_other_items_stay() -> None:
    queue = filled([Sensor.ODOM, None, Sensor.SCAN, Sensor.ODOM, None])
    queue.drop_messages()
    assert emptied(queue) == [1, 4]
    assert queue.dropped() == {Sensor.ODOM: {QueueDrop.STOPPED: 2}, Sensor.SCAN: {QueueDrop.STOPPED: 1}}


def test_a_refused_message_is_counted() -> None:
    queue = Queue(LIMITS)
    assert queue.fits(Sensor.ODOM, 100)
    assert not queue.fits(Sensor.ODOM, 101)
    queue.refuse(Sensor.ODOM, QueueDrop.TOO_LARGE)
    assert queue.dropped() == {Sensor.ODOM: {QueueDrop.TOO_LARGE: 1}}
    assert queue.received()[Sensor.ODOM] == 1


def test_nothing_comes_from_an_empty_queue() -> None:
    assert Queue(LIMITS).pop(0.01) is None


def test_a_wake_ends_the_present_wait_or_the_next_one() -> None:
    queue = Queue(LIMITS)
    begun_s = time.monotonic()
    queue.wake()
    assert queue.pop(30.0) is None
    for wait in (queue.pop, queue.wait):
        threading.Timer(0.05, queue.wake).start()
        wait(30.0)
    assert time.monotonic() - begun_s < 10.0


def test_a_wait_is_not_ended_by_an_item_and_a_pop_is() -> None:
    queue = Queue(LIMITS)
    threading.Timer(0.02, queue.put, (7,)).start()
    begun_s = time.monotonic()
    queue.wait(0.2)
    assert time.monotonic() - begun_s >= 0.2
    assert queue.pop(0.0) == 7
    threading.Timer(0.02, queue.put, (8,)).start()
    assert queue.pop(30.0) == 8
