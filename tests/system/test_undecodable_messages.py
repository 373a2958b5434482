"""Messages that cannot be decoded are counted and told once."""

from dataclasses import replace
from pathlib import Path

import pytest
from drives import Arrival, Simulated, ate_m, change, lines, run, write
from faulty.faults import LASER_M, NO_LASER, garbage, replay_refused

from wayfi.frontends.measurements import LaserScan, Odometry, WifiScan

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
    assert report["warnings"] == [f"/odom: not used: {said}", NO_LASER]
    assert ate_m(tmp_path / "out", minute.truth) < LASER_M
