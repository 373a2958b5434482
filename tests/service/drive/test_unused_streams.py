"""A stream of which nothing can be used is named with the reason and a remedy, on the way or at the end."""

from collections import Counter

import pytest

from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.measurements import SECOND_NS, Sensor
from wayfi.service.drive.unused_streams import BLOCK, OF_READINGS, REMEDIES, UnusedStreams

TOPICS = {sensor: f"/{sensor}" for sensor in Sensor}
TOLD_OTHERWISE = {
    *(DropReason.UNDECODABLE, DropReason.INTERNAL_ERROR),  # with the error's own words
    *(DropReason.TOO_MANY_READINGS, DropReason.CONSTANT_LEVELS, DropReason.RANDOMISED_BSSIDS),  # of the receiver
    *(
        DropReason.NO_RETURN,
        DropReason.IMPOSSIBLE_SCAN,
        DropReason.CLOCK_OFF,
        DropReason.ABSURD_AGE,
    ),  # of the laser, or of the receiver
    *(DropReason.NO_TRANSFORM, DropReason.ABSURD_MOUNT, DropReason.TOO_MANY_FRAMES),  # of the frame
    *(DropReason.LOOP_OF_FRAMES, DropReason.RESTLESS_MOUNT, DropReason.OTHER_SOURCE),  # as above
    *(DropReason.OTHER_FRAME, DropReason.ABSURD_COVARIANCE),  # of the pose from outside
    DropReason.ADDS_NOTHING,  # one fix of a keyframe is enough
    DropReason.SENSOR_OFF,  # as the configuration wants it
}
STAMP_NS = 12 * SECOND_NS


class Drive:
    """Messages that are dropped for a reason, or used, and what is told of them."""

    def __init__(self) -> None:
        self.unused = UnusedStreams(TOPICS)
        self.messages: Counter[str] = Counter()
        self.told: list[Event] = []

    def add(self, count: int, *reasons: DropReason, sensor: Sensor = Sensor.SCAN) -> None:
        for _ in range(count):
            self.messages[TOPICS[sensor]] += 1
            dropped = [Dropped(sensor, STAMP_NS, reason) for reason in reasons]
            self.told += self.unused.judge(self.messages, dropped, 10 * SECOND_NS)

    def finish(self) -> list[str]:
        self.told += self.unused.finish(self.messages, 10 * SECOND_NS)
        return [e.text for e in self.told if isinstance(e, Warned)]


@pytest.mark.parametrize("reason", list(DropReason))
def test_every_reason_has_a_remedy_or_is_told_otherwise(reason: DropReason) -> None:
    assert (reason in REMEDIES) != (reason in TOLD_OTHERWISE)


@pytest.mark.parametrize("reason", sorted(REMEDIES.keys() - OF_READINGS))
@pytest.mark.parametrize("count", [1, 7, BLOCK, 3 * BLOCK])
def test_a_stream_that_is_dropped_whole_is_told_once(reason: DropReason, count: int) -> None:
    drive = Drive()
    drive.add(count, reason)
    (text,) = drive.finish()
    number = min(count, BLOCK)
    assert text.startswith(f"/scan: {number} of its {number} messages are not used: ")
    assert text.endswith(REMEDIES[reason].format(stamp_s=12.0, off="+2.0 s from the odometry's newest"))


@pytest.mark.parametrize("reason", sorted(TOLD_OTHERWISE))
def test_what_is_told_otherwise_is_not_told_twice(reason: DropReason) -> None:
    drive = Drive()
    drive.add(3 * BLOCK, reason)
    assert drive.finish() == []


def test_a_stream_of_which_a_part_is_used_is_not_complained_of() -> None:
    drive = Drive()
    for _ in range(50):
        drive.add(5, DropReason.DUPLICATE)
        drive.add(1)
    assert drive.finish() == []


def test_a_complaint_on_the_way_ends_when_messages_are_used_again() -> None:
    drive = Drive()
    drive.add(1000)
    drive.add(2 * BLOCK, DropReason.DUPLICATE)
    drive.add(2 * BLOCK)
    begins, ends = drive.told
    assert isinstance(begins, Warned)
    assert isinstance(ends, Warned)
    assert (begins.complaint, begins.ends) == (ends.complaint, not ends.ends) == ("/scan.unused", False)
    assert len(drive.finish()) == 2


def test_scans_without_a_usable_reading_are_told_by_what_is_wrong_with_their_readings() -> None:
    drive = Drive()
    drive.add(9, *[DropReason.ABSURD_RSSI] * 20, DropReason.MALFORMED_BSSID, DropReason.NO_READINGS, sensor=Sensor.WIFI)
    (text,) = drive.finish()
    assert text == f"/wifi: 9 of its 9 messages are not used: {REMEDIES[DropReason.ABSURD_RSSI]}"


def test_readings_that_are_too_old_leave_their_scans() -> None:
    drive = Drive()
    drive.add(2 * BLOCK, *[DropReason.TOO_LATE] * 10, sensor=Sensor.WIFI)
    assert drive.finish() == []


def test_what_a_receiver_is_complained_of_is_not_told_again() -> None:
    drive = Drive()
    warned = Warned(0, "its RSSI is in per cent", f"phone.b.{DropReason.ABSURD_RSSI}")
    drive.told += drive.unused.judge(drive.messages, [warned], 0)
    drive.add(2 * BLOCK, DropReason.ABSURD_RSSI, DropReason.NO_READINGS, sensor=Sensor.WIFI)
    assert drive.finish() == []


def test_of_several_reasons_the_commonest_is_told() -> None:
    drive = Drive()
    drive.add(10, DropReason.STAMP_BACK)
    drive.add(40, DropReason.DUPLICATE)
    (text,) = drive.finish()
    assert "their stamps do not move, the newest is 12.000 s" in text
