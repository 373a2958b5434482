"""Scans of several topics: used together, counted by topic, recorded and read back as they came."""

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scanning import FRONT, REAR, simulated

from wayfi.frontends.events import KeyframeAdded
from wayfi.frontends.measurements import LaserScan, Measurement, Odometry, Sensor, StaticTransforms
from wayfi.recordings.log import NullLog
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.blackbox.blackbox import BlackBox
from wayfi.service.config import Config, ConfigError, load_config
from wayfi.service.drive.live_drive import LiveDrive
from wayfi.service.replay.replay import ReplayOptions, replay, settings_for
from wayfi.service.transport.message_queue import Received

BOTH = 'recording.scan=["/scan_front", "/scan_rear"]'
SENSORS = {StaticTransforms: Sensor.TF_STATIC, Odometry: Sensor.ODOM, LaserScan: Sensor.SCAN}
Message = tuple[Sensor, str, bytes]


@pytest.fixture(scope="module")
def messages() -> list[Message]:
    """Ten seconds of two lasers; of the second, one scan is broken and one sees nothing."""
    front, rear = (simulated(mount, name).measurements for mount, name in ((FRONT, "front"), (REAR, "rear")))
    merged = [*front, *[m for m in rear if not isinstance(m, Odometry)]]
    merged.sort(key=lambda m: 0 if isinstance(m, StaticTransforms) else m.stamp_ns)
    out: list[Message] = []
    for m in merged[:320]:
        topic = f"/scan_{m.frame_id}" if isinstance(m, LaserScan) else f"/{SENSORS[type(m)]}"
        silent = replace(m, ranges=m.ranges * np.inf) if topic == "/scan_rear" and len(out) in range(100, 103) else m
        out.append((SENSORS[type(m)], topic, encode(silent)))
    last = max(number for number, (_, topic, _) in enumerate(out) if topic == "/scan_rear")
    return [*out[:last], (Sensor.SCAN, "/scan_rear", b"broken"), *out[last:], *odometry_after(merged)]


def odometry_after(measurements: list[Measurement]) -> list[Message]:
    return [(Sensor.ODOM, "/odom", encode(m)) for m in measurements[320:326] if isinstance(m, Odometry)]


def written(path: Path, messages: list[Message]) -> Path:
    with McapWriter(path) as writer:
        for number, (sensor, topic, data) in enumerate(messages):
            writer.write(topic, TYPE_OF_SENSOR[sensor], "cdr", number, data)
    return path


def test_a_replay_reads_all_of_them_and_counts_by_topic(tmp_path: Path, messages: list[Message]) -> None:
    recording = written(tmp_path / "a.mcap", messages)
    report = replay(recording, load_config((), [BOTH]), None, ReplayOptions(tmp_path / "out", rrd=False))
    count = sum(topic == "/scan_front" for _, topic, _ in messages)
    assert report["messages"]["/scan_front"] == count
    assert report["messages"]["/scan_rear"] >= count
    assert report["dropped"] == {"/scan_rear": {"undecodable": 1, "no_return": 1}}
    assert json.loads((tmp_path / "out" / "report.json").read_text())["dropped"] == report["dropped"]


def test_a_black_box_gives_the_same_drive(tmp_path: Path, messages: list[Message]) -> None:
    config = load_config((), [BOTH])
    live = LiveDrive(config, None, NullLog())
    with BlackBox(tmp_path, config, None) as box:
        for sensor, topic, data in messages:
            box.write(Received(sensor, topic, Encoding.CDR, data, time.monotonic()))
            live.feed(sensor, Encoding.CDR, data, topic)
            live.new_estimate()
    kept, _ = settings_for(tmp_path, (), (), None)
    assert kept.recording.scan == ["/scan_front", "/scan_rear"]
    report = replay(tmp_path, kept, None, ReplayOptions(tmp_path / "out", rrd=False))
    assert report["messages"] == dict(live.drive.counters.messages)
    lines = (tmp_path / "out" / "trajectory.tum").read_text().splitlines()
    final = live.drive.finish().final
    assert len(lines) == len(final)
    np.testing.assert_allclose([float(value) for value in lines[-1].split()[1:3]], final[-1, :2], atol=1e-9)


def test_the_second_topic_is_seen_as_well(messages: list[Message]) -> None:
    live = LiveDrive(load_config((), [BOTH]), None, NullLog())
    events = [e for s, topic, data in messages for e in live.feed(s, Encoding.CDR, data, topic)[0]]
    last = [e.points for e in events if isinstance(e, KeyframeAdded) and len(e.points)][-1]
    assert np.ptp(np.arctan2(last[:, 1], last[:, 0])) > 6.0


def test_a_string_is_one_topic_and_a_list_has_different_ones() -> None:
    assert Config().recording.every_topic[Sensor.SCAN] == ("/scan",)
    assert load_config((), ["recording.scan=/a"]).recording.every_topic[Sensor.SCAN] == ("/a",)
    assert load_config((), [BOTH]).recording.topics[Sensor.SCAN] == "/scan_front"
    for wrong in ("[]", '["/a", "/a"]', '["/a", ""]', "7", "[7]"):
        with pytest.raises(ConfigError, match=r"recording\.scan"):
            load_config((), [f"recording.scan={wrong}"])
