"""Recordings as people have them are read at the first try, or one line says what to type."""

import bz2
import gzip
import json
import os
import signal
import threading
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from drives import Simulated, ate_m, run, write
from faulty.bags import carmen_log, ros1_bag, rosbag2
from faulty.faults import LASER_M, refused
from faulty.files import packed, renamed, spoil
from mcap.writer import CompressionType
from mcap_files import chunk_indexes
from places import REAL_DATA
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from typer.testing import CliRunner

from wayfi.frontends.measurements import Sensor, StaticTransforms, WifiScan
from wayfi.recordings.bags.opening import open_any_recording
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.blocks import Record
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.cli.app import app

AS_FOUND = REAL_DATA / "as_found"
TOPICS = {topic: sensor for sensor, topic in DEFAULT_TOPICS.items()}
YEAR_NS = 31_557_600_000_000_000


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


@pytest.fixture(scope="module")
def wheels_and_laser(minute: Simulated, tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Record], Path]:
    """The records of the first 20 s, and the folder of their replay."""
    folder = tmp_path_factory.mktemp("plain")
    path = write(folder / "plain.mcap", [a for a in minute.arrivals if a.second < 20.0])
    run(path, folder / "out")
    return list(open_recording(path)), folder / "out"


def assert_same(out: Path, other: Path) -> None:
    for name in ("trajectory.tum", "online.tum", "radio.csv", "map.pgm"):
        assert (out / name).read_bytes() == (other / name).read_bytes()


@pytest.mark.parametrize(
    ("storage", "mode"),
    [
        (StoragePlugin.SQLITE3, CompressionMode.NONE),
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
        (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.NONE),
        (StoragePlugin.MCAP, CompressionMode.FILE),
    ],
)
def test_a_rosbag2_folder_and_its_file_replay_as_the_mcap_does(
    wheels_and_laser: tuple[list[Record], Path], tmp_path: Path, storage: StoragePlugin, mode: CompressionMode
) -> None:
    records, plain = wheels_and_laser
    folder = rosbag2(tmp_path / "bag", records, storage, mode)
    run(folder, tmp_path / "out")
    assert_same(tmp_path / "out", plain)
    (file,) = (path for path in folder.iterdir() if path.suffix != ".yaml")
    assert list(open_any_recording(file)) == records


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_a_ros_1_bag_replays_as_the_mcap_does(
    wheels_and_laser: tuple[list[Record], Path], tmp_path: Path, compression: str
) -> None:
    records, plain = wheels_and_laser
    report = run(ros1_bag(tmp_path / "drive.bag", records, compression), tmp_path / "out")
    assert report["warnings"] == json.loads((plain / "report.json").read_text())["warnings"]
    assert_same(tmp_path / "out", plain)


@pytest.mark.parametrize("packed_as", ["", ".gz", ".bz2"])
def test_a_carmen_log_replays_as_the_mcap_does(minute: Simulated, tmp_path: Path, packed_as: str) -> None:
    first = [a for a in minute.without(WifiScan, StaticTransforms) if a.second < 15.0]
    path = write(tmp_path / "plain.mcap", first)
    log = carmen_log(tmp_path / "drive.log", open_recording(path))
    run(path, tmp_path / "plain")
    if packed_as:
        compress = {".gz": gzip.compress, ".bz2": bz2.compress}[packed_as]
        log = log.with_name(f"drive.log{packed_as}")
        log.write_bytes(compress((tmp_path / "drive.log").read_bytes()))
    report = run(log, tmp_path / "out")
    assert report["messages"] == {"/odom": 150, "/scan": 150, "/tf_static": 1}
    ours, plain = (read_tum(tmp_path / name / "trajectory.tum") for name in ("out", "plain"))
    assert ours.stamps_ns == pytest.approx(plain.stamps_ns, abs=1_000)
    assert np.abs(ours.poses - plain.poses).max() < 0.02  # the text has no time increment


def test_an_imported_bag_is_an_mcap_of_the_same_messages(
    wheels_and_laser: tuple[list[Record], Path], tmp_path: Path
) -> None:
    records, _ = wheels_and_laser
    bag = ros1_bag(tmp_path / "drive.bag", records)
    done = CliRunner().invoke(app, ["import", str(bag), "--out", str(tmp_path / "drive.mcap")])
    assert done.exit_code == 0, done.output
    assert list(open_recording(tmp_path / "drive.mcap")) == records
    assert "cannot be written" in refused("import", bag, "--out", tmp_path / "missing" / "drive.mcap")


@pytest.mark.parametrize("name", ["a.mcap", "a.db3", "a.bag", "a.log", "a.clf", "a", "a.db3.zstd", "a.bag.gz"])
@pytest.mark.parametrize("content", [b"", b"garbage\n" * 400, bytes(range(256)) * 40])
def test_garbage_is_refused_in_one_line(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    for command in ("replay", "import"):
        assert name in refused(command, tmp_path / name, "--out", tmp_path / "out")
    assert name in refused("inspect", tmp_path / name)


@pytest.mark.parametrize(
    ("numbers", "shift_ns"),
    [(range(3), None), (range(200, 203), None), (range(300, 10_000), 20 * YEAR_NS)],
    ids=["log time 0 at first", "log time 0 on the way", "twenty years on the way"],
)
def test_log_times_of_another_age_are_told_and_not_waited_for(
    minute: Simulated, tmp_path: Path, numbers: range, shift_ns: int | None
) -> None:
    first = [a for a in minute.arrivals if a.second < 20.0]
    with McapWriter(tmp_path / "odd.mcap") as writer:
        for n, r in enumerate(open_recording(write(tmp_path / "plain.mcap", first))):
            log_time_ns = r.log_time_ns if n not in numbers else 0 if shift_ns is None else r.log_time_ns + shift_ns
            writer.write(r.topic, r.type_name, r.encoding, log_time_ns, r.data)
    report = run(tmp_path / "odd.mcap", tmp_path / "odd", rate=50.0)
    run(tmp_path / "plain.mcap", tmp_path / "plain")
    assert any("gap" in line and "log time" in line for line in report["warnings"])
    assert report["recording_s"] == pytest.approx(20.0, abs=1.0)
    assert report["wall_s"] < 60.0
    assert_same(tmp_path / "odd", tmp_path / "plain")


def test_an_interrupt_ends_a_wait_at_once(minute: Simulated, tmp_path: Path) -> None:
    path = write(tmp_path / "slow.mcap", [a for a in minute.arrivals if a.second < 5.0])
    interrupt = threading.Timer(3.0, os.kill, (os.getpid(), signal.SIGINT))
    begun = time.monotonic()
    interrupt.start()
    with pytest.raises(KeyboardInterrupt):
        run(path, tmp_path / "out", rate=0.0001)  # the next message is due after minutes
    assert time.monotonic() - begun < 60.0


@pytest.mark.skipif(not AS_FOUND.is_dir(), reason="the real recordings are not beside the project (../shared/data)")
@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("tb4_mac2", {"/odom": 920, "/scan": 357, "/tf": 953, "/tf_static": 2}),
        ("tb4_mac2/macfirst_floor_take_2_0.db3", {"/odom": 920, "/scan": 357}),
        ("okazaki_subset.bag", {"/odom": 233, "/scan": 186, "/tf": 796}),
        ("two_lasers.bag", {"/front_scan": 331, "/rear_scan": 330}),
        ("fr079.clf.bz2", {"/odom": 8951, "/scan": 4934, "/tf_static": 1}),
    ],
)
def test_files_as_their_owners_have_them_are_read(name: str, counts: dict[str, int]) -> None:
    recording = open_any_recording(AS_FOUND / name)
    read: Counter[str] = Counter()
    for r in recording:
        read[r.topic] += 1
        sensor = TOPICS.get(r.topic, Sensor.SCAN if r.topic.endswith("scan") else None)
        if sensor is not None:
            decode(r.data, sensor, Encoding(r.encoding))
    assert read == recording.message_counts
    assert read.items() >= counts.items()
    assert recording.warnings == []


@pytest.mark.skipif(not AS_FOUND.is_dir(), reason="the real recordings are not beside the project (../shared/data)")
def test_a_real_folder_of_rosbag2_replays_as_the_mcap_does(tmp_path: Path) -> None:
    run(AS_FOUND / "tb4_mac2", tmp_path / "found")
    run(AS_FOUND.parent / "tb4_mac2" / "recording.mcap", tmp_path / "mcap")
    assert_same(tmp_path / "found", tmp_path / "mcap")
