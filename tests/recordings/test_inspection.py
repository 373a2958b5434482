"""Inspection: what is counted in a recording, and which of its topics are used."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from places import REAL_DATA

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, LaserScan, Odometry, Sensor, WifiScan
from wayfi.recordings.inspection import Inspection, TopicInspection, inspect_recording
from wayfi.recordings.mcap.blocks import RecordingError
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS, LASER_SCAN, ODOMETRY, WIFI_SCAN
from wayfi.recordings.ros.topics import Encoding


def wifi(stamp_ns: int, receiver: str, bssid: str) -> bytes:
    number = np.array([-50.0], dtype=np.float32)
    return encode(WifiScan(stamp_ns, receiver, (bssid,), number, 0 * number), Encoding.JSON)


def write(path: Path) -> Path:
    stamps_s = [0, 1, 2, 2, 1, 4, 10]
    with McapWriter(path) as writer:
        for at, stamp_s in enumerate(stamps_s):
            pose = Pose2(math.nan if at == 3 else 0.0, 0.0, 0.0)
            writer.write("/odom", ODOMETRY, "cdr", at * SECOND_NS, encode(Odometry(stamp_s * SECOND_NS, pose)))
        writer.write("/odom", ODOMETRY, "cdr", 7 * SECOND_NS, b"\0\1\0\0nonsense")
        scan = LaserScan(SECOND_NS, "laser", np.ones(180, np.float32), 0.0, 0.01, 0.1, 30.0)
        writer.write("/base_scan", LASER_SCAN, "cdr", 2 * SECOND_NS, encode(scan))
        for at, receiver in enumerate(["phone", "robot"] * 2):
            data = wifi(at // 2 * SECOND_NS, receiver, f"00:00:00:00:00:0{at}")
            writer.write("/wifi", "", "json", at * SECOND_NS, data)
        writer.write("/chatter", "std_msgs/msg/String", "cdr", 0, b"\0\1\0\0")
        writer.write("/tf_static", "tf/tfMessage", "cdr", 0, b"\0\1\0\0")
        writer.write("/wayfi/marks", "wayfi/Mark", "json", 0, b"{}")
        writer.write("/points", "", "protobuf", 2**64 - 1, b"")
    return path


def topic(inspection: Inspection, name: str) -> TopicInspection:
    return next(topic for topic in inspection.topics if topic.topic == name)


def test_faults_gaps_and_rates_are_counted(tmp_path: Path) -> None:
    odom = topic(inspect_recording(open_recording(write(tmp_path / "a.mcap"))), "/odom")
    assert odom.used
    assert (odom.count, odom.undecodable, odom.non_finite) == (8, 1, 1)
    assert (odom.time_faults.jumps_back, odom.time_faults.duplicates) == (1, 1)
    assert (odom.first_stamp_ns, odom.last_stamp_ns) == (0, 10 * SECOND_NS)
    assert odom.longest_gap_s == 6.0
    assert odom.rate_hz == pytest.approx(1 / 1.5)


def test_wifi_counts_receivers_and_bssids_and_receivers_may_share_stamps(tmp_path: Path) -> None:
    found = topic(inspect_recording(open_recording(write(tmp_path / "a.mcap"))), "/wifi")
    assert (found.used, found.encoding, found.receivers, found.bssids) == (True, "json", ("phone", "robot"), 4)
    assert (found.time_faults.jumps_back, found.time_faults.duplicates) == (0, 0)


def test_unused_topics_say_why(tmp_path: Path) -> None:
    recording = open_recording(write(tmp_path / "a.mcap"))
    inspection = inspect_recording(recording, {**DEFAULT_TOPICS, Sensor.SCAN: "/front_scan"})
    why = {found.topic: found.why for found in inspection.topics if not found.used}
    assert "read from /front_scan" in why["/base_scan"]
    assert "no sensor is configured" in why["/chatter"]
    assert "unknown type tf/tfMessage" in why["/tf_static"]
    assert "unknown encoding protobuf" in why["/points"]
    assert "a replay does what the daemon did" in why["/wayfi/marks"]
    assert inspection.usable


def test_a_topic_found_by_its_type_is_used_and_told(tmp_path: Path) -> None:
    inspection = inspect_recording(open_recording(write(tmp_path / "a.mcap")))
    assert topic(inspection, "/base_scan").used
    assert any(line.startswith("/base_scan is read for scan") for line in inspection.warnings)


def test_configured_topics_are_used(tmp_path: Path) -> None:
    inspection = inspect_recording(open_recording(write(tmp_path / "a.mcap")), {Sensor.SCAN: "/base_scan"})
    scan = topic(inspection, "/base_scan")
    assert (scan.used, scan.beams, scan.rate_hz) == (True, 180, None)
    assert [found.topic for found in inspection.topics if found.used] == ["/base_scan"]


def test_a_recording_without_odometry_and_scans_is_not_usable(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with McapWriter(path) as writer:
        writer.write("/wifi", WIFI_SCAN, "json", 0, wifi(0, "phone", "00:00:00:00:00:01"))
        writer.write("/odom", ODOMETRY, "cdr", 0, b"")
    assert not inspect_recording(open_recording(path)).usable


def test_the_dictionary_is_strict_json(tmp_path: Path) -> None:
    plain = inspect_recording(open_recording(write(tmp_path / "a.mcap"))).to_dict()
    assert json.loads(json.dumps(plain, allow_nan=False))["message_count"] == 17


def test_a_cut_file_is_inspected_with_its_warning(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap")
    path.write_bytes(path.read_bytes()[:-10])
    inspection = inspect_recording(open_recording(path))
    assert "a.mcap is cut off after 17 messages; used what is complete" in inspection.warnings


def test_nothing_to_inspect_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError):
        inspect_recording(open_recording(tmp_path / "missing.mcap"))


@pytest.mark.skipif(not REAL_DATA.is_dir(), reason="the real recordings are not beside the project (../shared/data)")
def test_a_real_recording_is_as_its_description_says() -> None:
    inspection = inspect_recording(open_recording(REAL_DATA / "b24test2" / "recording.mcap"))
    odom, found = topic(inspection, "/odom"), topic(inspection, "/wifi")
    assert odom.rate_hz == pytest.approx(10.0, rel=0.05)
    assert found.rate_hz == pytest.approx(1.0, rel=0.05)
    assert found.bssids == 588
    assert all(each.used and not each.undecodable for each in inspection.topics)
