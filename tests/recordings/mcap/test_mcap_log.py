"""Recordings: order, rotated parts, black boxes, and files that are unfinished, cut, damaged or no MCAP at all."""

import hashlib
import itertools
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import ChunkIndex
from mcap.writer import CompressionType, Writer
from places import REAL_DATA
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import Odometry, Sensor
from wayfi.recordings.mcap.recording import (
    BLACKBOX_PROFILE,
    McapWriter,
    Record,
    RecordingError,
    open_recording,
    read_mcap,
)
from wayfi.recordings.ros.codec import Encoding, decode, encode
from wayfi.recordings.ros.messages import ODOMETRY, TYPE_OF_SENSOR, WIFI_SCAN

REAL_COUNTS = {
    "b14test1": {"/odom": 7300, "/wifi": 731},
    "b24test2": {"/odom": 7470, "/wifi": 747},
    "b3test2": {"/odom": 9901, "/wifi": 991},
    "flat_calib3": {"/tf_static": 1, "/odom": 2687, "/scan": 573, "/wifi": 739},
    "intel": {"/tf_static": 1, "/odom": 910, "/scan": 910},
    "intel_wifi": {"/tf_static": 1, "/odom": 910, "/scan": 910, "/wifi": 2651},
}


def payload(number: int) -> bytes:
    return encode(Odometry(number, Pose2(number, 0.0, 0.0)))


def record(number: int, log_time_ns: int, topic: str = "/odom") -> Record:
    return Record(topic, ODOMETRY, "cdr", log_time_ns, payload(number))


def put(writer: McapWriter, records: list[Record]) -> None:
    for r in records:
        writer.write(r.topic, r.type_name, r.encoding, r.log_time_ns, r.data)


def write(path: Path, records: list[Record], profile: str = "ros2", flush_every: int = 10) -> Path:
    with McapWriter(path, profile) as writer:
        for at in range(0, len(records), flush_every):
            put(writer, records[at : at + flush_every])
            writer.flush()
    return path


def numbers(path: Path) -> list[int]:
    return [decode(r.data, Sensor.ODOM, Encoding.CDR).stamp_ns for r in read_mcap(path)]


def chunk_indexes(path: Path) -> list[ChunkIndex]:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return summary.chunk_indexes


@settings(deadline=None, max_examples=40)
@given(st.lists(st.integers(0, 30), min_size=1, max_size=60), st.integers(1, 20))
def test_records_come_back_in_log_time_order_equal_times_in_file_order(
    tmp_path_factory: pytest.TempPathFactory, times: list[int], flush_every: int
) -> None:
    records = [record(number, time) for number, time in enumerate(times)]
    path = write(tmp_path_factory.mktemp("order") / "a.mcap", records, flush_every=flush_every)
    expected = sorted(records, key=lambda r: r.log_time_ns)
    assert list(read_mcap(path)) == expected
    cut = path.with_name("cut.mcap")
    cut.write_bytes(path.read_bytes()[:-20])
    assert list(read_mcap(cut)) == expected


def test_what_is_known_before_reading(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", [record(1, 2_000_000_000), record(2, 5_000_000_000, "/odom2")])
    recording = open_recording(path)
    assert dict(recording.message_counts) == {"/odom": 1, "/odom2": 1}
    assert (recording.message_count, recording.duration_s) == (2, 3.0)
    assert recording.paths == [path]
    assert recording.sha256() == hashlib.sha256(path.read_bytes()).hexdigest()
    assert not recording.is_blackbox
    assert recording.warnings == []
    assert list(recording) == list(recording)


def test_the_same_calls_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.mcap", "b.mcap"):
        with McapWriter(tmp_path / name) as writer:
            put(writer, [record(n, n) for n in range(50)])
            writer.write_metadata("wayfi", {"a": "1"})
            writer.attach("config.toml", b"x = 1\n")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_metadata_and_attachments_come_back_and_the_last_of_a_name_wins(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with McapWriter(path) as writer:
        put(writer, [record(1, 1)])
        writer.write_metadata("map", {"dir": "old"})
        writer.write_metadata("map", {"dir": "new"})
        writer.attach("config.toml", b"x = 1\n", "application/toml", 7)
        put(writer, [record(2, 2)])
        writer.flush()
        unfinished = path.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(unfinished)
    for file in (path, cut):
        recording = open_recording(file)
        assert recording.metadata() == {"map": {"dir": "new"}}
        assert recording.attachments() == {"config.toml": b"x = 1\n"}
        assert [r.log_time_ns for r in recording] == [1, 2]


def test_a_damaged_attachment_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with McapWriter(path) as writer:
        put(writer, [record(1, 1)])
        writer.attach("config.toml", b"find me")
    path.write_bytes(path.read_bytes().replace(b"find me", b"find it"))
    recording = open_recording(path)
    assert recording.attachments() == {}
    assert len(recording.warnings) == 1


def test_files_are_read_by_the_mcap_library_and_their_schemas_by_rosbags(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", [record(3, 4)])
    with path.open("rb") as file:
        [(schema, channel, message)] = make_reader(file, validate_crcs=True).iter_messages()
    assert schema is not None
    assert (schema.name, schema.encoding, channel.message_encoding) == (ODOMETRY, "ros2msg", "cdr")
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(schema.data.decode(), ODOMETRY))
    assert store.deserialize_cdr(message.data, ODOMETRY).pose.pose.position.x == 3.0  # type: ignore[attr-defined]


def test_json_and_unknown_types_keep_their_names(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    written = [
        Record("/wifi", WIFI_SCAN, "json", 1, b"{}"),
        Record("/wifi", WIFI_SCAN, "cdr", 2, b"\0\1\0\0"),
        Record("/chatter", "my_msgs/msg/Chatter", "cdr", 3, b"\0\1\0\0"),
        Record("/bare", "", "json", 4, b"1"),
    ]
    with McapWriter(path) as writer:
        put(writer, written)
    assert list(read_mcap(path)) == written


def test_size_grows_with_each_flush(tmp_path: Path) -> None:
    with McapWriter(tmp_path / "a.mcap") as writer:
        empty = writer.size_bytes
        put(writer, [record(1, 1)])
        writer.flush()
        assert writer.size_bytes > empty
        assert writer.size_bytes == (tmp_path / "a.mcap").stat().st_size
        writer.close()


def test_a_killed_writer_loses_only_what_it_did_not_flush(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    script = f"""
import os, signal
from pathlib import Path
from wayfi.recordings.mcap.recording import McapWriter
writer = McapWriter(Path({str(path)!r}))
for n in range(150):
    writer.write("/odom", {ODOMETRY!r}, "cdr", 1000 - n, b"%d" % n)
    if n == 99:
        writer.flush()
os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == -9
    recording = open_recording(path)
    assert [int(r.data) for r in recording] == list(range(99, -1, -1))
    assert recording.warnings == ["a.mcap is cut off after 100 messages; used what is complete"]


def test_a_file_cut_anywhere_gives_a_beginning_of_it(tmp_path: Path) -> None:
    whole = write(tmp_path / "a.mcap", [record(n, n) for n in range(60)]).read_bytes()
    cut = tmp_path / "cut.mcap"
    counts = []
    for size in range(8, len(whole), 7):
        cut.write_bytes(whole[:size])
        try:
            recording = open_recording(cut)
        except RecordingError:
            counts.append(0)
            continue
        found = [r.log_time_ns for r in recording]
        assert found == list(range(len(found)))
        assert recording.warnings == [f"cut.mcap is cut off after {len(found)} messages; used what is complete"]
        counts.append(len(found))
    assert counts == sorted(counts)
    assert set(counts) == set(range(0, 61, 10))


def test_an_unfinished_file_padded_with_zeros_is_read_up_to_them(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", [record(n, n) for n in range(20)])
    path.write_bytes(path.read_bytes()[: chunk_indexes(path)[1].chunk_start_offset] + bytes(4096))
    assert numbers(path) == list(range(10))


@pytest.mark.parametrize("finished", [True, False])
def test_a_damaged_chunk_costs_itself_and_one_warning(tmp_path: Path, finished: bool) -> None:
    path = write(tmp_path / "a.mcap", [record(n, n) for n in range(30)])
    middle = chunk_indexes(path)[1]
    data = bytearray(path.read_bytes())
    at = middle.chunk_start_offset + middle.chunk_length - 40
    data[at : at + 20] = bytes(20)
    path.write_bytes(data if finished else data[:-30])
    recording = open_recording(path)
    assert [r.log_time_ns for r in recording] == [*range(10), *range(20, 30)]
    assert len(recording.warnings) == 1
    assert "damaged" in recording.warnings[0]


def test_random_damage_is_never_more_than_a_recording_error(tmp_path: Path) -> None:
    whole = write(tmp_path / "a.mcap", [record(n, n) for n in range(40)]).read_bytes()
    damaged = tmp_path / "damaged.mcap"
    for at, value in itertools.product(range(8, len(whole), 13), (0, 255)):
        data = bytearray(whole)
        data[at] = value
        damaged.write_bytes(data)
        try:
            recording = open_recording(damaged)
            found = list(recording)
            recording.metadata()
        except RecordingError:
            continue
        assert len(found) <= 40
        assert len(recording.warnings) <= 1


@pytest.mark.parametrize("chunked", [True, False])
def test_other_writers_files_are_read_too(tmp_path: Path, chunked: bool) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=chunked, compression=CompressionType.NONE, use_statistics=False)
        writer.start("ros2")
        channel = writer.register_channel("/odom", "cdr", writer.register_schema(ODOMETRY, "ros2msg", b""))
        for time in (5, 3, 4, 3):
            writer.add_message(channel, time, payload(time), time)
        writer.finish()  # type: ignore[no-untyped-call]
    assert [r.log_time_ns for r in read_mcap(path)] == [3, 3, 4, 5]
    path.write_bytes(path.read_bytes()[:-50])
    assert [r.log_time_ns for r in read_mcap(path)] == [3, 3, 4, 5]


def test_a_channel_known_only_from_a_later_chunk_is_known_in_time(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", [record(n, 100 - n) for n in range(30)])
    path.write_bytes(path.read_bytes()[:-10])
    assert numbers(path) == list(range(29, -1, -1))


def test_parts_are_merged_by_log_time_and_equal_times_by_part(tmp_path: Path) -> None:
    write(tmp_path / "part_10.mcap", [record(n, time) for n, time in enumerate([30, 31, 45], 20)])
    write(tmp_path / "part_9.mcap", [record(n, time) for n, time in enumerate([20, 30, 40], 10)])
    write(tmp_path / "part_1.mcap", [record(n, time) for n, time in enumerate([90, 91], 40)])
    recording = open_recording(tmp_path)
    assert [path.name for path in recording.paths] == ["part_9.mcap", "part_10.mcap", "part_1.mcap"]
    assert numbers(tmp_path) == [10, 11, 20, 21, 12, 22, 40, 41]
    assert recording.message_count == 8


def test_a_part_that_cannot_be_read_is_left_out_with_a_warning(tmp_path: Path) -> None:
    write(tmp_path / "part_1.mcap", [record(1, 1)])
    (tmp_path / "part_2.mcap").write_bytes(b"")
    recording = open_recording(tmp_path)
    assert len(list(recording)) == 1
    assert len(recording.warnings) == 1
    assert "part_2.mcap is empty; left out" in recording.warnings[0]


def test_a_black_box_comes_in_file_order(tmp_path: Path) -> None:
    for part, times in enumerate([[50, 40], [10, 60, 20], [5]]):
        records = [record(10 * part + n, time) for n, time in enumerate(times)]
        write(tmp_path / f"blackbox_{part + 8}.mcap", records, BLACKBOX_PROFILE)
    write(tmp_path / "other.mcap", [record(99, 0)])
    recording = open_recording(tmp_path)
    assert recording.is_blackbox
    assert [r.log_time_ns for r in recording] == [50, 40, 10, 60, 20, 5]
    assert open_recording(tmp_path / "blackbox_9.mcap").is_blackbox
    last = tmp_path / "blackbox_9.mcap"
    last.write_bytes(last.read_bytes()[:-10])
    assert [r.log_time_ns for r in open_recording(last)] == [10, 60, 20]


@pytest.mark.parametrize(
    ("content", "says"),
    [(b"", "is empty"), (b"# nothing\n", "is not an MCAP"), (b"\x89MCAP0\r\n", "has no messages"), (None, "exist")],
)
def test_what_is_no_recording_is_a_recording_error(tmp_path: Path, content: bytes | None, says: str) -> None:
    path = tmp_path / "a.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RecordingError, match=says) as caught:
        open_recording(path)
    assert isinstance(caught.value, WayfiError)
    assert "\n" not in str(caught.value)


def test_nothing_in_it_is_a_recording_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"without \.mcap files"):
        open_recording(tmp_path)
    write(tmp_path / "a.mcap", [])
    with pytest.raises(RecordingError, match="has no messages"):
        open_recording(tmp_path)


def test_a_place_that_cannot_be_written_is_a_recording_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot write"):
        McapWriter(tmp_path / "missing" / "a.mcap")


@pytest.mark.skipif(not REAL_DATA.is_dir(), reason="the real recordings are not beside the project (../shared/data)")
@pytest.mark.parametrize("name", REAL_COUNTS)
def test_real_recordings_are_read_whole(name: str) -> None:
    recording = open_recording(REAL_DATA / name / "recording.mcap")
    sensors = {f"/{sensor}": sensor for sensor in Sensor}
    counts = dict.fromkeys(recording.message_counts, 0)
    last_ns = 0
    for r in recording:
        assert r.log_time_ns >= last_ns
        assert r.type_name == TYPE_OF_SENSOR[sensors[r.topic]]
        decode(r.data, sensors[r.topic], Encoding.CDR)
        counts[r.topic] += 1
        last_ns = r.log_time_ns
    assert counts == dict(recording.message_counts) == REAL_COUNTS[name]
    assert recording.warnings == []
