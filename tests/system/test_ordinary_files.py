"""Recordings as people have them are read at the first try, or one line says what to type."""

from pathlib import Path

import pytest
from drives import Simulated, ate_m, run, write
from faulty.faults import LASER_M

from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter


def renamed(drive: Simulated, path: Path, topics: dict[str, list[str]]) -> Path:
    """The drive as a recording with each message on the topics that its own is called there."""
    whole = write(path.with_name("whole.mcap"), drive.arrivals)
    with McapWriter(path) as writer:
        for r in open_recording(whole):
            for topic in topics.get(r.topic, [r.topic]):
                writer.write(topic, r.type_name, r.encoding, r.log_time_ns, r.data)
    return path


@pytest.mark.parametrize(
    "topics",
    [
        {"/scan": ["/robot1/scan"]},
        {"/scan": ["/base_scan"], "/odom": ["/wheel/odometry"], "/tf_static": ["/robot1/tf_static"]},
        {topic: [f"/a/b{topic}"] for topic in ("/odom", "/scan", "/wifi", "/tf_static")},
    ],
)
def test_other_topics_are_found_by_their_types(minute: Simulated, tmp_path: Path, topics: dict[str, list[str]]) -> None:
    report = run(renamed(minute, tmp_path / "renamed.mcap", topics), tmp_path / "out")
    assert ate_m(tmp_path / "out", minute.truth) < LASER_M
    assert report["dropped"] == {}
    for (topic,) in topics.values():
        assert sum(line.startswith(f"{topic} is read for") for line in report["warnings"]) == 1


def test_of_two_lasers_neither_is_chosen_and_the_settings_are_named(minute: Simulated, tmp_path: Path) -> None:
    path = renamed(minute, tmp_path / "two.mcap", {"/scan": ["/front/scan", "/rear/scan"]})
    warnings = run(path, tmp_path / "out")["warnings"]
    assert any("--set recording.scan=/front/scan or --set recording.scan=/rear/scan" in line for line in warnings)
    report = run(path, tmp_path / "front", "recording.scan=/front/scan")
    assert ate_m(tmp_path / "front", minute.truth) < LASER_M
    assert not any("recording.scan" in line for line in report["warnings"])
