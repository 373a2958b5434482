"""Files that are cut, damaged or of other writers: what is complete is read."""

import itertools
from pathlib import Path

import pytest
from mcap.writer import CompressionType, Writer
from mcap_files import chunk_indexes, numbers, payload, put, record, write

from wayfi.recordings.mcap.blocks import RecordingError
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.messages import ODOMETRY


def test_a_damaged_attachment_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with McapWriter(path) as writer:
        put(writer, [record(1, 1)])
        writer.attach("config.toml", b"find me", "application/toml")
    path.write_bytes(path.read_bytes().replace(b"find me", b"find it"))
    recording = open_recording(path)
    assert recording.attachments() == {}
    assert len(recording.warnings) == 1


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
            recording.attachments()
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
    assert [r.log_time_ns for r in open_recording(path)] == [3, 3, 4, 5]
    path.write_bytes(path.read_bytes()[:-50])
    assert [r.log_time_ns for r in open_recording(path)] == [3, 3, 4, 5]


def test_a_channel_known_only_from_a_later_chunk_is_known_in_time(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", [record(n, 100 - n) for n in range(30)])
    path.write_bytes(path.read_bytes()[:-10])
    assert numbers(path) == list(range(29, -1, -1))
