"""JSON as phones, scripts and JavaScript write it is decoded; what cannot be is counted and told once."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drives import Arrival, Simulated, ate_m, change, lines, run, write
from faulty.faults import LASER_M, NO_LASER, garbage, replay_refused
from faulty.outcomes import Change, Outcome, drive, of

from wayfi.frontends.measurements import LaserScan, Odometry, Sensor, WifiScan
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import Encoding

UNDECODABLE = {"empty": b"", "a header alone": b"\0\1\0\0", "noise": bytes(range(256)), "no CDR": b"\xff" * 700}


def ten_seconds(minute: Simulated) -> list[Arrival]:
    """The first ones of a drive, with the scans that end within them."""
    return [a for a in minute.arrivals if a.second < (9.9 if isinstance(a.measurement, LaserScan) else 10.01)]


@pytest.mark.parametrize("kind", [Odometry, LaserScan, WifiScan])
@pytest.mark.parametrize("name", UNDECODABLE)
def test_undecodable_messages_are_counted_and_told_once(
    kind: type[Odometry | LaserScan | WifiScan], name: str, minute: Simulated, tmp_path: Path
) -> None:
    topic = {Odometry: "/odom", LaserScan: "/scan", WifiScan: "/wifi"}[kind]
    first = ten_seconds(minute)
    arrivals = change(first, kind, [2, 3, 8], garbage(UNDECODABLE[name]))
    report = run(write(tmp_path / "recording.mcap", arrivals), tmp_path / "out")
    assert report["dropped"] == {topic: {"undecodable": 3}}
    assert [warning.split(":")[0] for warning in report["warnings"]] == [topic]
    assert len(lines(tmp_path / "out" / "trajectory.tum")) == 101 - 3 * (kind is Odometry)


def test_json_where_fields_are_missing_is_undecodable(minute: Simulated, tmp_path: Path) -> None:
    first = ten_seconds(minute)
    spoiled = [
        replace(a, encoding="json", data=b'{"header": {"stamp": {"sec": 1}}}' if a.second < 2 else b"{")
        if isinstance(a.measurement, WifiScan)
        else a
        for a in first
    ]
    report = run(write(tmp_path / "recording.mcap", spoiled), tmp_path / "out")
    assert report["dropped"] == {"/wifi": {"undecodable": 10}}


def test_an_unknown_encoding(minute: Simulated, tmp_path: Path) -> None:
    unknown = [replace(a, encoding="protobuf") if isinstance(a.measurement, Odometry) else a for a in minute.arrivals]
    alone = [a for a in unknown if isinstance(a.measurement, Odometry)]
    said = "unknown encoding protobuf; odom takes cdr or json"
    assert said in replay_refused(write(tmp_path / "alone.mcap", alone), tmp_path / "out")
    report = run(write(tmp_path / "recording.mcap", unknown), tmp_path / "out")
    unused, leads = report["warnings"]
    assert unused.startswith(f"/odom: not used: {said}, and recordings ros1 as well: convert its messages")
    assert leads == NO_LASER
    assert ate_m(tmp_path / "out", minute.truth) < LASER_M


# JSON as it is written


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
def as_sent(half_minute: Simulated) -> Outcome:
    """What comes of the drive as it was simulated, in CDR."""
    return drive(list(half_minute.arrivals), half_minute.truth)


@pytest.mark.parametrize("name", WRITTEN)
def test_json_as_it_is_written_gives_the_same_drive(name: str, half_minute: Simulated, as_sent: Outcome) -> None:
    kind, written = WRITTEN[name]
    outcome = drive(of(kind, written)(list(half_minute.arrivals)), half_minute.truth)
    assert outcome.told == as_sent.told == []
    assert outcome.used == as_sent.used
    assert np.abs(outcome.final - as_sent.final).max() < (2e-3 if written is WRITTEN["no limit of a scan"][1] else 1e-6)


@pytest.mark.parametrize("encoding", ["json", "", "utf-8"])
def test_json_of_any_encoding_is_read_and_what_is_dropped_is_told(
    encoding: str, half_minute: Simulated, tmp_path: Path
) -> None:
    written = of(Odometry, as_json(lambda m: m["pose"]["pose"].pop("position"), encoding))(
        half_minute.without(LaserScan)
    )
    line = replay_refused(write(tmp_path / "recording.mcap", written), tmp_path / "out")
    assert f"{DEFAULT_TOPICS[Sensor.ODOM]}: cannot be decoded: pose.pose.position.x is missing" in line


def test_a_message_that_is_dropped_on_the_way_is_told_with_the_codecs_reason(half_minute: Simulated) -> None:
    arrivals = change(
        half_minute.arrivals, WifiScan, [3, 4], lambda a: replace(a, encoding="json", data=b'{"header": 1}')
    )
    assert drive(arrivals, half_minute.truth).told == ["/wifi: cannot be decoded: header is int, not a JSON object"]
