"""Readings of all ages, gathered where they were taken."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.wifi.readings import PlacedWifiScan, Readings
from wayfi.frontends.wifi.readings_by_place import ReadingsByPlace
from wayfi.frontends.wifi.wifi_config import ByPlaceConfig

CONFIG = ByPlaceConfig()
S = 1_000_000_000
NEVER_NS = 10**18
SPEED_M_S = 0.5
BSSIDS = tuple(f"ap{n}" for n in range(20))


def point(second: float, speed_m_s: float = SPEED_M_S) -> PathPoint:
    return PathPoint(round(second * S), Pose2(speed_m_s * second, 0.0, 0.0), speed_m_s * second)


def readings(rssi: list[float], ages_s: list[float]) -> Readings:
    return Readings(BSSIDS[: len(rssi)], np.array(rssi, np.float32), np.array(ages_s, np.float32))


def add(by_place: ReadingsByPlace, second: float, ages_s: list[float], speed_m_s: float = SPEED_M_S) -> None:
    """A scan that ends at a `second`, whose levels tell, in -dBm, where on the path the readings were taken."""
    taken_m = speed_m_s * (second - np.array(ages_s))
    heard = readings((-taken_m).tolist(), ages_s)
    taken = point(second - (by_place.common_age_s(heard) or 0.0), speed_m_s)
    by_place.add(PlacedWifiScan("phone", taken, heard, taken_m))


def level_of(placed: PlacedWifiScan) -> dict[str, float]:
    return dict(zip(placed.readings.bssids, placed.readings.rssi.tolist(), strict=True))


AGES = st.lists(st.floats(0, 25, width=32), min_size=1, max_size=20)


@given(st.lists(AGES, min_size=1, max_size=20))
def test_what_counts_at_a_place_was_heard_near_it(scans: list[list[float]]) -> None:
    by_place = ReadingsByPlace(CONFIG)
    for second, ages_s in enumerate(scans, start=30):
        add(by_place, float(second), ages_s)
    ready = by_place.ready(NEVER_NS)
    for placed in ready:
        assert np.abs(placed.readings.rssi + placed.point.path_m).max() <= CONFIG.near_m + 1e-4


@given(st.floats(0, 25, width=32), st.lists(st.floats(0, 0.4375, width=32), min_size=1, max_size=20))
def test_a_scan_of_one_age_stays_as_it_is_where_it_was_taken(age_s: float, later_s: list[float]) -> None:
    by_place = ReadingsByPlace(CONFIG)
    for second in (29.0, 30.0):
        add(by_place, second, [age_s + later for later in later_s])
    *_, placed = by_place.ready(30 * S)
    assert placed.readings.bssids == BSSIDS[: len(later_s)]
    assert np.abs(placed.readings.rssi + placed.point.path_m).max() <= 0.5 * CONFIG.together_s * SPEED_M_S + 1e-4


@given(st.lists(AGES, min_size=1, max_size=20))
def test_every_reading_near_the_end_of_a_scan_counts(scans: list[list[float]]) -> None:
    by_place = ReadingsByPlace(CONFIG)
    for second, ages_s in enumerate(scans, start=30):
        add(by_place, float(second), ages_s)
    ready = by_place.ready(NEVER_NS)
    levels = {placed.point.stamp_ns // S: level_of(placed) for placed in ready if placed.point.stamp_ns % S == 0}
    for ended, ages_s in enumerate(scans, start=30):
        if max(ages_s) - min(ages_s) <= CONFIG.together_s:
            continue
        for second, others_s in enumerate(scans, start=30):
            for bssid, age_s in zip(BSSIDS, others_s, strict=False):
                if abs(second - age_s - ended) * SPEED_M_S < CONFIG.near_m - 1e-4:
                    assert bssid in levels[ended]


def test_several_readings_of_one_access_point_give_their_mean() -> None:
    by_place = ReadingsByPlace(CONFIG)
    for second in range(30, 40):
        add(by_place, float(second), [1.0, 5.0])
    middle = by_place.ready(NEVER_NS)[3]
    heard_m = [p for p in SPEED_M_S * (np.arange(30, 40) - 1.0) if abs(p - middle.point.path_m) <= CONFIG.near_m]
    assert len(heard_m) > 2
    assert level_of(middle)[BSSIDS[0]] == pytest.approx(-np.mean(heard_m))


def test_a_scan_is_ready_when_most_readings_of_its_place_have_come() -> None:
    by_place = ReadingsByPlace(CONFIG)
    add(by_place, 30.0, [0.0, 0.0, 0.0])
    add(by_place, 32.0, [0.0, 2.0, 4.0, 4.0, 4.0])
    assert [p.point.stamp_ns for p in by_place.ready(30 * S)] == [30 * S]
    assert by_place.ready(35 * S) == []
    assert [p.point.stamp_ns for p in by_place.ready(36 * S)] == [32 * S]
    assert by_place.ready(NEVER_NS) == []


def test_receivers_are_kept_apart() -> None:
    by_place = ReadingsByPlace(CONFIG)
    for receiver, level in (("one", -40.0), ("two", -60.0)):
        by_place.add(PlacedWifiScan(receiver, point(30.0), readings([level] * 2, [0.0, 1.0]), np.array([15.0, 14.5])))
    assert {p.receiver: set(p.readings.rssi.tolist()) for p in by_place.ready(NEVER_NS)} == {
        "one": {-40.0},
        "two": {-60.0},
    }


def test_readings_whose_place_is_not_known_count_nowhere() -> None:
    by_place = ReadingsByPlace(CONFIG)
    by_place.add(PlacedWifiScan("phone", point(30.0), readings([-40.0, -50.0], [1.0, 50.0]), np.array([14.5, np.nan])))
    (placed,) = by_place.ready(NEVER_NS)
    assert placed.readings.bssids == BSSIDS[:1]


def test_readings_too_old_to_have_a_place_hold_up_none() -> None:
    by_place = ReadingsByPlace(CONFIG)
    by_place.add(PlacedWifiScan("phone", point(30.0), readings([-40.0, -50.0], [1.0, 1e6]), np.array([14.5, np.nan])))
    assert len(by_place.ready(31 * S)) == 1


def test_a_robot_that_stands_still_gathers_no_more_and_no_more() -> None:
    by_place = ReadingsByPlace(CONFIG)

    def size_after(start: int, stop: int) -> int:
        for second in range(start, stop):
            add(by_place, float(second), [0.0, 1.0, 2.0], speed_m_s=0.0)
            by_place.ready(second * S)
        return len(pickle.dumps(by_place))

    early = size_after(0, 200)
    assert size_after(200, 2000) < 1.1 * early
