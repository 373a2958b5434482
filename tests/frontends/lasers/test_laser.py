"""Lasers told apart by topic and frame; what one of them sends is corrected, dropped or told."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.lasers.laser import MOST_LASERS, Laser, Lasers
from wayfi.frontends.lidar.lidar_config import LaserWatchConfig
from wayfi.frontends.measurements import LaserScan, PointCloud

CONFIG = LaserWatchConfig()
SOUND = LaserScan(0, "laser", np.full(360, 2.0, np.float32), -math.pi, math.radians(1.0), 0.1, 30.0)
BROKEN = replace(SOUND, angle_increment=0.0, angle_max=math.pi)


def received(laser: Laser, scans: Iterable[LaserScan]) -> tuple[list[LaserScan], list[Event]]:
    out: list[LaserScan] = []
    events: list[Event] = []
    for number, scan in enumerate(scans):
        receiving = laser.receive(0, replace(scan, stamp_ns=number * 100_000_000))
        try:
            while True:
                events.append(next(receiving))
        except StopIteration as done:
            out += done.value
    return out, events


def laser() -> Laser:
    return Lasers(CONFIG).of(SOUND)


def test_sound_scans_go_through_unchanged() -> None:
    out, events = received(laser(), [SOUND] * 5)
    numbers = {(scan.angle_min, scan.angle_increment, scan.range_min_m, scan.range_max_m) for scan in out}
    assert numbers == {(-math.pi, math.radians(1.0), 0.1, 30.0)}
    assert all(scan.ranges is SOUND.ranges for scan in out)
    assert not events


def test_a_fault_from_the_first_scan_on_is_corrected_at_once_and_told_after_three() -> None:
    out, events = received(laser(), [BROKEN] * 10)
    assert len(out) == 10
    assert all(math.isclose(scan.angle_increment, 2 * math.pi / 359) for scan in out)
    (warned,) = events
    assert isinstance(warned, Warned)
    assert warned.text.startswith("laser 'laser': angle_increment 0 cannot be of 360 beams")


def test_a_broken_scan_among_sound_ones_is_dropped_and_a_fault_that_lasts_is_corrected() -> None:
    out, events = received(laser(), [SOUND] * 5 + [BROKEN] + [SOUND] * 5)
    assert len(out) == 10
    assert [event.reason for event in events if isinstance(event, Dropped)] == [DropReason.IMPOSSIBLE_SCAN]
    out, events = received(laser(), [SOUND] * 5 + [BROKEN] * 10 + [SOUND] * 10)
    assert len(out) == 23
    assert [event.ends for event in events if isinstance(event, Warned)] == [False, True]


def test_lasers_are_told_apart_by_topic_and_frame_with_or_without_its_slash() -> None:
    lasers = Lasers(CONFIG)
    same = [lasers.of(SOUND), lasers.of(replace(SOUND, frame_id="/laser", stamp_ns=5))]
    assert same[0] is same[1]
    others = [replace(SOUND, topic="/rear"), replace(SOUND, frame_id="rear"), PointCloud(0, "laser", np.ones((1, 3)))]
    streams = {lasers.of(sweep).stream for sweep in [SOUND, *others]}
    assert len(streams) == 4
    assert "scan" in streams  # the first laser's stamps are those of scans, as ever
    assert lasers.of(others[0]).name == "laser 'laser' on /rear"


def test_of_many_lasers_those_heard_of_last_are_remembered() -> None:
    lasers = Lasers(CONFIG)
    sound, streams = lasers.of(SOUND), set()
    for number in range(10 * MOST_LASERS):
        streams.add(lasers.of(replace(SOUND, frame_id=f"laser {number}")).stream)
        assert lasers.of(SOUND) is sound
    assert len(list(lasers)) == MOST_LASERS
    assert len(streams | {sound.stream}) == MOST_LASERS
