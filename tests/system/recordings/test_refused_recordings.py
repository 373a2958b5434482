"""A recording with nothing to use is refused in one line."""

import math
from pathlib import Path

import pytest
from drives import Simulated, change, write
from faulty.faults import (
    at_pose,
    replay_refused,
)

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import LaserScan, Odometry
from wayfi.recordings.mcap.writer import McapWriter


def test_a_missing_file(tmp_path: Path) -> None:
    line = replay_refused(tmp_path / "nothing.mcap", tmp_path / "out")
    assert line == f"wayfi: {tmp_path / 'nothing.mcap'} does not exist"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("data", "said"), [(b"", "is empty"), (b"PK\3\4 and so on", "is not an MCAP file"), (b"\x89MCAP", "not an MCAP")]
)
def test_a_file_that_is_no_recording(tmp_path: Path, data: bytes, said: str) -> None:
    (tmp_path / "recording.mcap").write_bytes(data)
    assert said in replay_refused(tmp_path / "recording.mcap", tmp_path / "out")


def test_a_folder_without_recordings(tmp_path: Path) -> None:
    assert "is a folder without .mcap files" in replay_refused(tmp_path, tmp_path / "out")


def test_results_cannot_go_where_a_file_is(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.arrivals[:50])
    assert "cannot be made" in replay_refused(recording, recording)


def test_no_usable_topic(tmp_path: Path) -> None:
    with McapWriter(tmp_path / "recording.mcap") as writer:
        writer.write("/chatter", "std_msgs/msg/String", "cdr", 0, b"\0\1\0\0")
    line = replay_refused(tmp_path / "recording.mcap", tmp_path / "out")
    assert "nothing usable on /odom or /scan" in line
    assert "/chatter (no sensor is configured for this topic (type std_msgs/msg/String))" in line


def test_wifi_alone_is_nothing_to_do(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.without(Odometry, LaserScan))
    assert "60 x /wifi no_pose" in replay_refused(recording, tmp_path / "out")


def test_odometry_of_nothing_but_faults(minute: Simulated, tmp_path: Path) -> None:
    faulty = change(minute.without(LaserScan), Odometry, range(601), at_pose(Pose2(math.nan, 0.0, 0.0)))
    recording = write(tmp_path / "recording.mcap", faulty)
    assert "601 x /odom non_finite" in replay_refused(recording, tmp_path / "out")
