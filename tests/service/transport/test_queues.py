"""What waits for the pipeline: bounded, in the order of arrival, every drop counted."""

from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.transport.queues import QUEUE_BYTES, QueueDrop, QueueLimit, Queues

LIMITS = dict.fromkeys(Sensor, QueueLimit(messages=5, message_bytes=100))


def filled(arrivals: list[Sensor]) -> Queues:
    queues = Queues(LIMITS)
    for number, sensor in enumerate(arrivals):
        queues.put(sensor, Encoding.CDR, str(number).encode())
    return queues


def emptied(queues: Queues) -> list[int]:
    out = []
    while received := queues.take(0.0):
        out.append(int(received.data))
    return out


@settings(deadline=None)
@given(st.lists(st.sampled_from(Sensor)))
def test_the_latest_of_each_sensor_come_out_in_the_order_of_arrival(arrivals: list[Sensor]) -> None:
    queues = filled(arrivals)
    latest = {n for sensor in Sensor for n in [i for i, s in enumerate(arrivals) if s is sensor][-5:]}
    assert emptied(queues) == sorted(latest)


@settings(deadline=None)
@given(st.lists(st.sampled_from(Sensor)))
def test_whatever_came_was_taken_or_counted(arrivals: list[Sensor]) -> None:
    queues = filled(arrivals)
    waiting = queues.depths()
    for sensor in Sensor:
        dropped = queues.dropped().get(sensor, {}).get(QueueDrop.QUEUE_FULL, 0)
        assert waiting[sensor] + dropped == arrivals.count(sensor) == queues.received()[sensor]


def test_a_queue_is_bounded_in_bytes() -> None:
    queues = Queues(dict.fromkeys(Sensor, QueueLimit(messages=100, message_bytes=QUEUE_BYTES)))
    for _ in range(4):
        queues.put(Sensor.POINTS, Encoding.CDR, bytes(QUEUE_BYTES // 2))
    assert queues.depths()[Sensor.POINTS] == 2
    assert queues.dropped() == {Sensor.POINTS: {QueueDrop.QUEUE_FULL: 2}}


def test_what_waits_at_the_end_is_counted() -> None:
    queues = filled([Sensor.ODOM, Sensor.SCAN, Sensor.ODOM])
    queues.clear()
    assert queues.take(0.0) is None
    assert queues.dropped() == {Sensor.ODOM: {QueueDrop.STOPPED: 2}, Sensor.SCAN: {QueueDrop.STOPPED: 1}}


def test_what_is_refused_is_counted() -> None:
    queues = Queues(LIMITS)
    assert queues.fits(Sensor.ODOM, 100)
    assert not queues.fits(Sensor.ODOM, 101)
    queues.refuse(Sensor.ODOM, QueueDrop.TOO_LARGE)
    assert queues.dropped() == {Sensor.ODOM: {QueueDrop.TOO_LARGE: 1}}
    assert queues.received()[Sensor.ODOM] == 1


def test_nothing_comes_from_empty_queues() -> None:
    assert Queues(LIMITS).take(0.01) is None
