"""What the drivers of ordinary lasers send: it is used as it was meant, or the warning says what is wrong."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scanning import FRONT, GOOD_M, Change, Drive, clockwise, each, last_bearing, run, simulated

from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import LaserScan, Measurement, PointCloud
from wayfi.recordings.simulation.worlds.blueprints import World


@pytest.fixture(scope="module")
def front() -> Drive:
    return simulated(FRONT, "front")


@pytest.fixture(scope="module")
def office() -> Drive:
    return simulated(FRONT, "front", World.OFFICE)


def test_the_drive_itself_is_good_and_nothing_is_told(front: Drive) -> None:
    done = run(front)
    assert done.ate_m < GOOD_M
    assert not done.told
    assert not done.dropped()


CORRECTED = {
    "no increment": (each(angle_increment=lambda _: 0.0), "angle_increment 0 cannot be"),
    "an infinite increment": (each(angle_increment=lambda _: math.inf), "angle_increment inf cannot be"),
    "a huge increment": (each(angle_increment=lambda _: 0.5), "angle_increment 0.5 cannot be"),
    "an increment in degrees": (each(angle_increment=lambda s: math.degrees(s.angle_increment)), "is in degrees"),
    "degrees": (
        each(
            angle_min=lambda s: math.degrees(s.angle_min),
            angle_max=lambda s: math.degrees(last_bearing(s)),
            angle_increment=lambda s: math.degrees(s.angle_increment),
        ),
        "angle_min -135 is in degrees",
    ),
    "millimetres": (
        each(ranges=lambda s: s.ranges * 1000, range_min_m=lambda _: 60.0, range_max_m=lambda _: 30_000.0),
        "in millimetres",
    ),
    "millimetres within metres": (each(ranges=lambda s: s.ranges * 1000), "in millimetres"),
    "centimetres": (
        each(ranges=lambda s: s.ranges * 100, range_min_m=lambda _: 6.0, range_max_m=lambda _: 3000.0),
        "in centimetres",
    ),
    "no range_max": (each(range_max_m=lambda _: 0.0), "range_max is 0: no limit"),
    "limits swapped": (each(range_min_m=lambda s: s.range_max_m, range_max_m=lambda s: s.range_min_m), "swapped"),
    "the whole sweep's time": (
        each(time_increment_s=lambda _: 0.1, scan_time_s=lambda _: 0.1),
        "time_increment of 0.1 s makes a sweep of 36 s, with 0.1 s between scans: it is the whole sweep's",
    ),
    "milliseconds": (each(time_increment_s=lambda _: 0.2), "it is in ms, and a sweep of 0.072 s is used"),
    "a sweep of 4 s": (each(time_increment_s=lambda _: 0.011, scan_time_s=lambda _: 0.0), "a sweep of 0.075 s is used"),
}


@pytest.mark.parametrize("fault", CORRECTED)
def test_numbers_that_cannot_be_right_are_corrected_and_told(front: Drive, fault: str) -> None:
    change, told = CORRECTED[fault]
    done = run(front.with_scans(change))
    assert done.ate_m < GOOD_M
    assert told in done.told
    assert done.told.startswith("laser 'front'")
    assert len(done.dropped()) < 20


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (each(angle_increment=lambda s: 0.6 * s.angle_increment), "lie evenly up to angle_max, which is used"),
        (each(angle_increment=lambda s: 1.3 * s.angle_increment), "lie evenly up to angle_max, which is used"),
        (each(angle_max=lambda _: 1.0), "straight by angle_increment, which is used"),
    ],
    ids=["too small an increment", "too large an increment", "a stale angle_max"],
)
def test_walls_tell_whether_the_increment_or_the_last_bearing_is_right(
    office: Drive, change: Change, told: str
) -> None:
    done = run(office.with_scans(change))
    assert told in done.told
    assert done.ate_m < run(office).ate_m + GOOD_M
    assert len(done.dropped()) < 20


def test_where_walls_do_not_tell_the_increment_is_believed_and_told(front: Drive) -> None:
    """In the car park pillars stand before every wall."""
    done = run(front.with_scans(each(angle_max=lambda _: 1.0)))
    assert "end at 2.356: angle_increment is believed" in done.told
    assert done.ate_m < GOOD_M


def wrapped(scan: LaserScan) -> list[LaserScan]:
    """The bearings from 225 degrees on, and up to 135."""
    return [replace(scan, angle_min=scan.angle_min + 2 * math.pi)]


def a_beam_too_many(scan: LaserScan) -> list[LaserScan]:
    return [replace(scan, angle_max=last_bearing(scan) + scan.angle_increment)]


@pytest.mark.parametrize("change", [clockwise, wrapped, a_beam_too_many])
def test_what_sound_drivers_send_is_used_without_a_word(front: Drive, change: Change) -> None:
    done = run(front.with_scans(change))
    assert done.ate_m < GOOD_M
    assert not done.told


REFUSED = {
    "nothing to go by": (each(angle_increment=lambda _: 0.0, angle_max=lambda s: s.angle_min), "would cover nothing"),
    "more than a turn": (
        each(angle_increment=lambda _: 0.05, angle_max=lambda s: s.angle_min + 18.0),
        "361 beams would cover 2.9 turns",
    ),
    "not a number": (each(angle_min=lambda _: math.nan), "angle_min nan and angle_max"),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_bearings_that_nothing_tells_are_refused_by_name(front: Drive, fault: str) -> None:
    change, told = REFUSED[fault]
    done = run(front.with_scans(change))
    assert told in done.told
    assert set(done.dropped()) == {DropReason.IMPOSSIBLE_SCAN}


UNUSED: dict[str, tuple[Change, str, str]] = {
    "beyond the range that is used": (each(), "lidar.max_range_m=0.2", "beyond lidar.max_range_m, 0.2 m (--set lidar"),
    "beyond range_max": (each(range_max_m=lambda _: 1.5), "", "beyond its range_max of 1.5 m"),
    "few beams": (
        each(ranges=lambda s: s.ranges[::30], angle_increment=lambda s: 30 * s.angle_increment),
        "",
        "few beams: 11 points are left of the 13 that it sends, and a match takes 30 (--set lidar.min_points=11)",
    ),
    "no return": (each(ranges=lambda s: np.full_like(s.ranges, np.inf)), "", "few of its beams return"),
}


@pytest.mark.parametrize("fault", UNUSED)
def test_scans_of_which_nothing_is_used_are_told_with_the_reason(front: Drive, fault: str) -> None:
    change, setting, told = UNUSED[fault]
    assert told in run(front.with_scans(change), *([setting] if setting else [])).told


@pytest.mark.parametrize(
    ("height_m", "seen"), [(-0.3, "-0.10 and -0.10"), (2.0, "2.20 and 2.20"), (9.0, "9.20 and 9.2")]
)
def test_clouds_outside_of_the_height_band_are_told_with_their_heights(
    front: Drive, height_m: float, seen: str
) -> None:
    def as_cloud(m: Measurement) -> Measurement:
        if not isinstance(m, LaserScan):
            return m
        bearings = m.angle_min + m.angle_increment * np.arange(len(m.ranges))
        level = np.full(len(bearings), height_m)
        ranges = np.nan_to_num(m.ranges, posinf=0.0)
        points = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings), level], axis=1)
        return PointCloud(m.stamp_ns, m.frame_id, points.astype(np.float32))

    clouds = Drive([as_cloud(m) for m in front.measurements if m.stamp_ns % 500_000_000 < 200_000_000], front.truth)
    told = run(clouds).told
    assert "height band, between 0.2 and 1.8 m" in told
    assert f"its points are between {seen}" in told


@pytest.mark.parametrize(
    ("points", "told"), [(0, "its clouds hold no points"), (3, "none of its points is finite")], ids=["empty", "NaN"]
)
def test_clouds_without_any_point_are_told(front: Drive, points: int, told: str) -> None:
    def as_cloud(m: Measurement) -> Measurement:
        nothing = np.full((points, 3), np.nan, np.float32)
        return PointCloud(m.stamp_ns, m.frame_id, nothing) if isinstance(m, LaserScan) else m

    assert told in run(Drive([as_cloud(m) for m in front.measurements], front.truth)).told
