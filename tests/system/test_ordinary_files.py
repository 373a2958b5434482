"""Recordings as people have them are read at the first try, or one line says what to type."""

from pathlib import Path

import pytest
from drives import Simulated, ate_m, run
from faulty.faults import LASER_M
from faulty.files import packed, renamed, spoil
from mcap.writer import CompressionType
from mcap_files import chunk_indexes


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


@pytest.mark.parametrize("compression", list(CompressionType), ids=lambda compression: compression.name)
@pytest.mark.parametrize("inside", [True, False], ids=["inside a chunk", "between chunks"])
def test_damage_costs_what_is_damaged_and_is_told(
    minute: Simulated, tmp_path: Path, compression: CompressionType, inside: bool
) -> None:
    path = packed(minute, tmp_path / "spoilt.mcap", compression)
    chunk = chunk_indexes(path)[20]
    spoil(path, chunk.chunk_start_offset + (chunk.chunk_length // 2 if inside else chunk.chunk_length + 2))
    report = run(path, tmp_path / "out")
    assert ate_m(tmp_path / "out", minute.truth) < LASER_M
    (told,) = [line for line in report["warnings"] if "damaged" in line]
    assert told.startswith("spoilt.mcap is damaged at byte")
    lost = len(minute.arrivals) - sum(report["messages"].values())
    assert lost <= (30 if inside else 0)
