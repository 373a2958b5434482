"""Clocks that are set, stand still or differ, and WiFi as it is written: it works, or one line says what is wrong."""

import random
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drives import Simulated, write
from faulty.faults import LASER_M, WHEELS_M, altered, replay_refused
from faulty.outcomes import Change, Outcome, drive, of

from wayfi.frontends.measurements import LaserScan, Odometry, WifiScan
from wayfi.recordings.trajectory import Trajectory

ALL = (Odometry, LaserScan, WifiScan)
STEP = 4  # messages at the most that a step costs of a sensor


def set_by(seconds: float) -> Change:
    return lambda arrival: arrival.stamped(seconds)


CLOCKS = {
    "laser back by 3 s": (
        [of(LaserScan, set_by(-3.0), 12.0)],
        ["laser 'laser' on /scan: its clock was set back by 3.000 s"],
    ),
    "laser ahead by 7 s": (
        [of(LaserScan, set_by(7.0), 15.0)],
        ["laser 'laser' on /scan: its clock was set forward by 7.000 s"],
    ),
    "laser back and ahead again": (
        [of(LaserScan, set_by(-20.0), 10.0, 22.0)],
        [
            "laser 'laser' on /scan: its clock was set back by 20.000 s",
            "laser 'laser' on /scan: its clock was set forward by 20.000 s",
        ],
    ),
    "odometry back by 12 s": ([of(Odometry, set_by(-12.0), 20.0)], ["odometry: its clock was set back by 12.000 s"]),
    "odometry back, later the laser too": (
        [of(Odometry, set_by(-4.0), 8.0), of(LaserScan, set_by(-4.0), 22.0)],
        ["odometry: its clock was set back by 4.000 s", "laser 'laser' on /scan: its clock was set back by 4.000 s"],
    ),
    "phones back by 6 s": (
        [of(WifiScan, set_by(-6.0), 10.0)],
        [f"WiFi receiver 'phone_{n}': its clock was set back by 6.0" for n in "ab"],
    ),
    "all back by 10 s": (
        [of(ALL, set_by(-10.0), 18.0)],
        ["odometry: its clock was set back by 10.000 s"],
    ),
}


@pytest.mark.parametrize("name", CLOCKS)
def test_a_clock_that_is_set_moves_its_own_sensor_alone(name: str, half_minute: Simulated) -> None:
    changes, told = CLOCKS[name]
    arrivals = list(half_minute.arrivals)
    for changed in changes:
        arrivals = changed(arrivals)
    outcome = drive(arrivals, half_minute.truth)
    assert outcome.ate_m < LASER_M
    assert len(outcome.told) == len(told)
    assert all(text.startswith(begin) for text, begin in zip(sorted(outcome.told), sorted(told), strict=True))
    assert outcome.used["/scan"] >= half_minute.count(LaserScan) - STEP * len(told)
    assert outcome.used["/wifi"] >= half_minute.count(WifiScan) - 2 * STEP
    assert outcome.used["/odom"] >= half_minute.count(Odometry) - STEP


def test_scans_and_wifi_follow_odometry_that_is_set_ahead(half_minute: Simulated) -> None:
    ahead = of(Odometry, set_by(6.0), 15.0)(list(half_minute.arrivals))
    stamps_ns = half_minute.truth.stamps_ns + np.where(
        half_minute.truth.stamps_ns >= ahead[0].at_ns + 15 * 10**9, 6 * 10**9, 0
    )
    outcome = drive(ahead, Trajectory(stamps_ns, half_minute.truth.poses))
    assert outcome.ate_m < LASER_M
    assert sorted(t.split(":")[0] for t in outcome.told) == [
        *(f"WiFi receiver 'phone_{n}'" for n in "ab"),
        "laser 'laser' on /scan",
    ]
    followed = r".*: the odometry's clock was set without its own; its stamps are shifted by \+(.*) s"
    shifts_s = [float(re.sub(followed, r"\1", text)) for text in outcome.told]
    assert shifts_s == pytest.approx([6.0] * 3, abs=0.1)  # the time between two messages of odometry


def test_a_laser_that_reboots_with_the_clock_of_its_start_is_placed_by_its_lag(half_minute: Simulated) -> None:
    silent = [a for a in half_minute.arrivals if not (isinstance(a.measurement, LaserScan) and 14.0 <= a.second < 18.3)]
    outcome = drive(of(LaserScan, set_by(-1.6e9), 18.3)(silent), half_minute.truth)
    assert outcome.ate_m < LASER_M
    assert any(re.match(r"laser 'laser' on /scan: its clock was set back by 16000000", text) for text in outcome.told)


STILL = {
    "0 from the start": of(LaserScan, lambda a: altered(a, stamp_ns=0)),
    "frozen on the way": of(LaserScan, lambda a: altered(a, stamp_ns=1_700_000_011 * 10**9), 11.0),
    "whole seconds": of(LaserScan, lambda a: altered(a, stamp_ns=a.measurement.stamp_ns // 10**9 * 10**9)),
}


@pytest.mark.parametrize("name", STILL)
def test_a_laser_whose_stamps_do_not_move_is_placed_where_the_odometry_is(name: str, half_minute: Simulated) -> None:
    outcome = drive(STILL[name](list(half_minute.arrivals)), half_minute.truth)
    assert outcome.ate_m < LASER_M
    assert any(
        text.startswith("laser 'laser' on /scan: its stamps do not move") and "header.stamp" in text
        for text in outcome.told
    )
    assert outcome.used["/scan"] > 0.9 * half_minute.count(LaserScan)


@pytest.mark.parametrize("stamp_ns", [0, 7, 1_700_000_000 * 10**9])
def test_where_no_stamp_moves_the_line_names_them(stamp_ns: int, half_minute: Simulated, tmp_path: Path) -> None:
    still = [replace(a, measurement=altered(a, stamp_ns=stamp_ns).measurement) for a in half_minute.arrivals[:600]]
    line = replay_refused(write(tmp_path / "recording.mcap", still), tmp_path / "out")
    assert "/odom: 50 of its 50 messages are not used: their stamps do not move" in line
    assert "fix header.stamp" in line


UNUSED = {
    "scans ahead": (of(LaserScan, set_by(100.0)), "/scan", r"stamps are \+99.\d s from .* synchronise the clocks"),
    "scans that are old": (of(LaserScan, set_by(-1e6)), "/scan", r"stamps are -1000000.\d s from .* too old"),
    "poses that are not finite": (
        of(Odometry, lambda a: altered(a, pose=a.measurement.pose._replace(x=np.nan))),  # type: ignore[union-attr]
        "/odom",
        "NaN or infinite",
    ),
}


@pytest.mark.parametrize("name", UNUSED)
def test_a_stream_of_which_nothing_can_be_used_is_named(name: str, half_minute: Simulated) -> None:
    changed, topic, why = UNUSED[name]
    outcome = drive(changed(list(half_minute.arrivals)), half_minute.truth)
    assert any(re.match(rf"{topic}: 50 of its 50 messages are not used: .*{why}", text) for text in outcome.told)
    assert outcome.ate_m < WHEELS_M


@pytest.mark.parametrize("seed", range(4))
def test_clocks_that_are_set_at_random_bend_no_map(seed: int, half_minute: Simulated) -> None:
    chance, arrivals = random.Random(seed), list(half_minute.arrivals)
    for _ in range(3):
        kinds: tuple[type, ...] = chance.choice(
            [(LaserScan,), (Odometry,), (WifiScan,), (Odometry, LaserScan, WifiScan)]
        )
        by_s = chance.choice((1.2, 5.0, 1000.0)) * chance.uniform(1.0, 1.5)
        back = Odometry in kinds or chance.random() < 0.5
        arrivals = of(kinds, set_by(-by_s if back else by_s), chance.uniform(4.0, 33.0))(arrivals)
    assert drive(arrivals, half_minute.truth).ate_m < LASER_M


# WiFi


@pytest.fixture(scope="module")
def without_laser(half_minute: Simulated) -> Outcome:
    """What comes of it by wheels and WiFi."""
    return drive(half_minute.without(LaserScan), half_minute.truth)


def bssids(how: Callable[[str], str]) -> Change:
    return lambda a: altered(a, bssids=tuple(map(how, a.measurement.bssids)))  # type: ignore[union-attr]


FORMS: dict[str, Callable[[str], str]] = {
    "a blank behind": lambda b: f"{b} ",
    "blanks around, upper case": lambda b: f" {b.upper()}\t",
    "dashes": lambda b: b.replace(":", "-"),
    "Cisco": lambda b: ".".join(re.findall("....", b.replace(":", ""))),
    "bare": lambda b: b.replace(":", "").upper(),
}


@pytest.mark.parametrize("name", FORMS)
def test_a_bssid_in_any_form_gives_the_same_drive(name: str, half_minute: Simulated, without_laser: Outcome) -> None:
    outcome = drive(of(WifiScan, bssids(FORMS[name]))(half_minute.without(LaserScan)), half_minute.truth)
    assert outcome.told == without_laser.told
    assert np.array_equal(outcome.final, without_laser.final)


def readings(**fields: Callable[[Any], Any]) -> Change:
    return lambda a: altered(a, **{name: how(getattr(a.measurement, name)) for name, how in fields.items()})


READINGS: dict[str, tuple[Change, str]] = {
    "per cent": (readings(rssi=lambda r: np.clip(2 * (r + 100), 0, 100)), r"RSSI is .*: per cent.*p / 2 - 100"),
    "without sign": (readings(rssi=np.negative), r"RSSI is .*dBm without their sign"),
    "hundredths": (readings(rssi=lambda r: 100 * r), r"RSSI is -\d+ to -\d+: hundredths of dBm\? .*divide by 100"),
    "no numbers": (readings(rssi=lambda r: np.nan * r), r"RSSI is not a number"),
    "ages in ms": (readings(age_s=lambda s: 1000 * s + 40), r"ages up to [\de+]+ s: are they in ms\? .*send seconds"),
    "names": (bssids(lambda b: f"office {b[:4]}"), r"BSSIDs are in a form that is not known, such as 'office .*'"),
}


@pytest.mark.parametrize("name", READINGS)
def test_readings_that_are_written_otherwise_are_told_of_each_receiver(name: str, half_minute: Simulated) -> None:
    changed, told = READINGS[name]
    outcome = drive(of(WifiScan, changed)(half_minute.without(LaserScan)), half_minute.truth)
    assert [re.match(rf"WiFi receiver 'phone_(.)': its .*{told}", text) is not None for text in outcome.told] == [
        True
    ] * 2
    assert outcome.ate_m < WHEELS_M
