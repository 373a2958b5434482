"""Clocks that are set or stand still, WiFi and JSON as they are written: it works, or one line says what is wrong."""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drives import Arrival, Simulated, change, simulated, write
from faulty.faults import LASER_M, WHEELS_M, altered, replay_refused

from wayfi.backend.pose2 import Floats
from wayfi.frontends.measurements import LaserScan, Odometry, Sensor, StaticTransforms, WifiScan
from wayfi.recordings.log import NullLog
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import Encoding
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import Config
from wayfi.service.drive.drive import Drive
from wayfi.service.evaluation.trajectory_scores import absolute_error

SENSORS = {
    Odometry: Sensor.ODOM,
    LaserScan: Sensor.SCAN,
    WifiScan: Sensor.WIFI,
    StaticTransforms: Sensor.TF_STATIC,
}
STEP = 4  # messages at the most that a step costs of a sensor
Change = Callable[[Arrival], Arrival]


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What came of a drive: its final poses, its warnings, and how many messages of each topic were used."""

    ate_m: float
    final: Floats
    told: list[str]
    used: dict[str, int]


def drive(arrivals: list[Arrival], truth: Trajectory) -> Outcome:
    """Feed the arrivals, in the order of their coming in, in this process."""
    drive = Drive(Config(), None, NullLog())
    for a in sorted(arrivals, key=lambda a: a.at_ns):
        sensor, said = SENSORS[type(a.measurement)], Encoding.CDR if a.encoding == "cdr" else Encoding.JSON
        drive.show(drive.feed(sensor, said, encode(a.measurement) if a.data is None else a.data))
    result, counters = drive.finish(), drive.counters
    error = absolute_error(Trajectory(result.stamps_ns, result.final), truth).error
    assert error.not_covered == 0
    used = {t: n - sum(counters.dropped.get(t, {}).values()) for t, n in counters.messages.items()}
    return Outcome(error.ate_rmse_m, result.final, counters.warnings, used)


@pytest.fixture(scope="module")
def sound() -> Simulated:
    """Half a minute of a robot that turns between the shelves."""
    return simulated(World.CARPARK, 0.6, seed=3)


@pytest.fixture(scope="module")
def without_laser(sound: Simulated) -> Outcome:
    """What comes of it by wheels and WiFi."""
    return drive(sound.without(LaserScan), sound.truth)


def of(kind: type, how: Change, from_s: float = 0.0, to_s: float = 1e9) -> Callable[[list[Arrival]], list[Arrival]]:
    """The arrivals with those of a kind changed, while they come in from `from_s` to `to_s`."""
    return lambda arrivals: [
        how(a) if isinstance(a.measurement, kind) and from_s <= a.second < to_s else a for a in arrivals
    ]


def set_by(seconds: float) -> Change:
    return lambda arrival: arrival.stamped(seconds)


# Clocks


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
        [of((Odometry, LaserScan, WifiScan), set_by(-10.0), 18.0)],  # type: ignore[arg-type]
        ["odometry: its clock was set back by 10.000 s"],
    ),
}


@pytest.mark.parametrize("name", CLOCKS)
def test_a_clock_that_is_set_moves_its_own_sensor_alone(name: str, sound: Simulated) -> None:
    changes, told = CLOCKS[name]
    arrivals = list(sound.arrivals)
    for changed in changes:
        arrivals = changed(arrivals)
    outcome = drive(arrivals, sound.truth)
    assert outcome.ate_m < LASER_M
    assert len(outcome.told) == len(told)
    assert all(text.startswith(begin) for text, begin in zip(sorted(outcome.told), sorted(told), strict=True))
    assert outcome.used["/scan"] >= sound.count(LaserScan) - STEP * len(told)
    assert outcome.used["/wifi"] >= sound.count(WifiScan) - 2 * STEP
    assert outcome.used["/odom"] >= sound.count(Odometry) - STEP


def test_scans_and_wifi_follow_odometry_that_is_set_ahead(sound: Simulated) -> None:
    ahead = of(Odometry, set_by(6.0), 15.0)(list(sound.arrivals))
    stamps_ns = sound.truth.stamps_ns + np.where(sound.truth.stamps_ns >= ahead[0].at_ns + 15 * 10**9, 6 * 10**9, 0)
    outcome = drive(ahead, Trajectory(stamps_ns, sound.truth.poses))
    assert outcome.ate_m < LASER_M
    assert sorted(t.split(":")[0] for t in outcome.told) == [
        *(f"WiFi receiver 'phone_{n}'" for n in "ab"),
        "laser 'laser' on /scan",
    ]
    followed = r".*: the odometry's clock was set without its own; its stamps are shifted by \+(.*) s"
    shifts_s = [float(re.sub(followed, r"\1", text)) for text in outcome.told]
    assert shifts_s == pytest.approx([6.0] * 3, abs=0.1)  # the time between two messages of odometry


def test_a_laser_that_reboots_with_the_clock_of_its_start_is_placed_by_its_lag(sound: Simulated) -> None:
    silent = [a for a in sound.arrivals if not (isinstance(a.measurement, LaserScan) and 14.0 <= a.second < 18.3)]
    outcome = drive(of(LaserScan, set_by(-1.6e9), 18.3)(silent), sound.truth)
    assert outcome.ate_m < LASER_M
    assert any(re.match(r"laser 'laser' on /scan: its clock was set back by 16000000", text) for text in outcome.told)


STILL = {
    "0 from the start": of(LaserScan, lambda a: altered(a, stamp_ns=0)),
    "frozen on the way": of(LaserScan, lambda a: altered(a, stamp_ns=1_700_000_011 * 10**9), 11.0),
    "whole seconds": of(LaserScan, lambda a: altered(a, stamp_ns=a.measurement.stamp_ns // 10**9 * 10**9)),
}


@pytest.mark.parametrize("name", STILL)
def test_a_laser_whose_stamps_do_not_move_is_placed_where_the_odometry_is(name: str, sound: Simulated) -> None:
    outcome = drive(STILL[name](list(sound.arrivals)), sound.truth)
    assert outcome.ate_m < LASER_M
    assert any(
        text.startswith("laser 'laser' on /scan: its stamps do not move") and "header.stamp" in text
        for text in outcome.told
    )
    assert outcome.used["/scan"] > 0.9 * sound.count(LaserScan)


@pytest.mark.parametrize("stamp_ns", [0, 7, 1_700_000_000 * 10**9])
def test_where_no_stamp_moves_the_line_names_them(stamp_ns: int, sound: Simulated, tmp_path: Path) -> None:
    still = [replace(a, measurement=altered(a, stamp_ns=stamp_ns).measurement) for a in sound.arrivals[:600]]
    line = replay_refused(write(tmp_path / "recording.mcap", still), tmp_path / "out")
    assert "/odom: 50 of its 50 messages are not used: their stamps do not move" in line
    assert "fix header.stamp" in line


UNUSED = {
    "scans ahead": (of(LaserScan, set_by(100.0)), "/scan", r"stamps are \+99.\d s from .* synchronise the clocks"),
    "scans that are old": (of(LaserScan, set_by(-1e6)), "/scan", r"stamps are -1000000.\d s from .* too old"),
    "poses that are not finite": (
        of(Odometry, lambda a: altered(a, pose=replace(a.measurement.pose, x=np.nan))),  # type: ignore[union-attr]
        "/odom",
        "NaN or infinite",
    ),
}


@pytest.mark.parametrize("name", UNUSED)
def test_a_stream_of_which_nothing_can_be_used_is_named(name: str, sound: Simulated) -> None:
    changed, topic, why = UNUSED[name]
    outcome = drive(changed(list(sound.arrivals)), sound.truth)
    assert any(re.match(rf"{topic}: 50 of its 50 messages are not used: .*{why}", text) for text in outcome.told)
    assert outcome.ate_m < WHEELS_M


# WiFi


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
def test_a_bssid_in_any_form_gives_the_same_drive(name: str, sound: Simulated, without_laser: Outcome) -> None:
    outcome = drive(of(WifiScan, bssids(FORMS[name]))(sound.without(LaserScan)), sound.truth)
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
def test_readings_that_are_written_otherwise_are_told_of_each_receiver(name: str, sound: Simulated) -> None:
    changed, told = READINGS[name]
    outcome = drive(of(WifiScan, changed)(sound.without(LaserScan)), sound.truth)
    assert [re.match(rf"WiFi receiver 'phone_(.)': its .*{told}", text) is not None for text in outcome.told] == [
        True
    ] * 2
    assert outcome.ate_m < WHEELS_M


# JSON


def as_json(how: Callable[[dict[str, Any]], Any], encoding: str = "json") -> Change:
    def changed(a: Arrival) -> Arrival:
        message = json.loads(encode(a.measurement, Encoding.JSON))
        how(message)
        return replace(a, encoding=encoding, data=json.dumps(message).encode())

    return changed


def no_limit(scan: dict[str, Any]) -> None:
    scan |= {"range_max": None, "angle_max": None, "intensities": None, "scan_time": None}


def as_ros1(odometry: dict[str, Any]) -> None:
    stamp = odometry["header"]["stamp"]
    odometry["header"]["stamp"] = {"secs": stamp["sec"], "nsecs": stamp["nanosec"]}
    odometry["twist"] = odometry["child_frame_id"] = odometry["pose"]["covariance"] = None


def hidden(scan: dict[str, Any]) -> None:
    for reading in scan["readings"][::2]:
        reading |= {"ssid": None, "frequency": None}


def as_text(scan: dict[str, Any]) -> None:
    for reading in scan["readings"]:
        reading["rssi"] = str(reading["rssi"])


def latin1(a: Arrival) -> Arrival:
    data = as_json(lambda m: m["readings"][0].update(ssid="caf#"))(a).data
    assert data
    return replace(a, encoding="json", data=data.replace(b"caf#", b"caf\xe9\x00\n"))


WRITTEN: dict[str, tuple[type, Change]] = {
    "no limit of a scan": (LaserScan, as_json(no_limit)),
    "ROS 1's names": (Odometry, as_json(as_ros1)),
    "hidden networks": (WifiScan, as_json(hidden)),
    "numbers as text": (WifiScan, as_json(as_text)),
    "bytes that are no text": (WifiScan, latin1),
    "JSON that is called CDR": (Odometry, as_json(lambda _: None, "cdr")),
    "CDR that is called JSON": (LaserScan, lambda a: replace(a, encoding="json")),
}


@pytest.fixture(scope="module")
def as_sent(sound: Simulated) -> Outcome:
    """What comes of the drive as it was simulated, in CDR."""
    return drive(list(sound.arrivals), sound.truth)


@pytest.mark.parametrize("name", WRITTEN)
def test_json_as_it_is_written_gives_the_same_drive(name: str, sound: Simulated, as_sent: Outcome) -> None:
    kind, written = WRITTEN[name]
    outcome = drive(of(kind, written)(list(sound.arrivals)), sound.truth)
    assert outcome.told == as_sent.told == []
    assert outcome.used == as_sent.used
    assert np.abs(outcome.final - as_sent.final).max() < (2e-3 if written is WRITTEN["no limit of a scan"][1] else 1e-6)


@pytest.mark.parametrize("encoding", ["json", "", "utf-8"])
def test_json_of_any_encoding_is_read_and_what_is_dropped_is_told(
    encoding: str, sound: Simulated, tmp_path: Path
) -> None:
    written = of(Odometry, as_json(lambda m: m["pose"]["pose"].pop("position"), encoding))(sound.without(LaserScan))
    line = replay_refused(write(tmp_path / "recording.mcap", written), tmp_path / "out")
    assert f"{DEFAULT_TOPICS[Sensor.ODOM]}: cannot be decoded: pose.pose.position.x is missing" in line


def test_a_message_that_is_dropped_on_the_way_is_told_with_the_codecs_reason(sound: Simulated) -> None:
    arrivals = change(sound.arrivals, WifiScan, [3, 4], lambda a: replace(a, encoding="json", data=b'{"header": 1}'))
    assert drive(arrivals, sound.truth).told == ["/wifi: cannot be decoded: header is int, not a JSON object"]
