"""Damage in a file costs what is damaged, wherever it is and however the chunks are compressed, and is told."""

import random
from pathlib import Path

import lz4.frame
import pytest
from mcap.writer import CompressionType, Writer
from mcap_files import chunk_indexes, record

from wayfi.recordings.mcap.blocks import Record
from wayfi.recordings.mcap.lz4_salvage import sound_beginning
from wayfi.recordings.mcap.recording import open_recording

RECORDS = [record(n, 1_000 + n, "/odom" if n % 3 else "/other") for n in range(600)]
A_CHUNK = 600 // 30 + 2


@pytest.fixture(params=list(CompressionType), ids=lambda compression: compression.name)
def sound(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """A recording in some thirty chunks."""
    path = tmp_path / "sound.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=15_000, compression=request.param)
        writer.start("ros2")
        channels = {
            topic: writer.register_channel(topic, "cdr", writer.register_schema(RECORDS[0].type_name, "ros2msg", b""))
            for topic in ("/odom", "/other")
        }
        for r in RECORDS:
            writer.add_message(channels[r.topic], r.log_time_ns, r.data, r.log_time_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def damaged(path: Path, at: int, count: int = 64, cut: int = 0, seed: int = 0) -> tuple[list[Record], str]:
    """The records that are read where `count` bytes are others, and what is told."""
    data = bytearray(path.read_bytes())
    data[at : at + count] = random.Random(seed).randbytes(count)
    other = path.with_name("damaged.mcap")
    other.write_bytes(data[: len(data) - cut])
    recording = open_recording(other)
    records = list(recording)
    (told,) = recording.warnings
    assert "damaged" in told
    assert "byte" in told
    return records, told


@pytest.mark.parametrize("cut", [0, 40], ids=["finished", "unfinished"])
@pytest.mark.parametrize("number", [1, 7, 20])
def test_damage_between_chunks_costs_nothing(sound: Path, cut: int, number: int) -> None:
    index = chunk_indexes(sound)[number]
    at = index.chunk_start_offset + index.chunk_length + 1
    records, _ = damaged(sound, at, cut=cut)
    assert records == RECORDS


@pytest.mark.parametrize("cut", [0, 40], ids=["finished", "unfinished"])
@pytest.mark.parametrize("before", [4, 30, 60])
def test_damage_where_a_chunk_begins_costs_at_most_that_chunk(sound: Path, cut: int, before: int) -> None:
    """The index at the end of the file says where the chunk is and how it is compressed."""
    records, _ = damaged(sound, chunk_indexes(sound)[9].chunk_start_offset - before, cut=cut)
    assert len(set(RECORDS) - set(records)) <= A_CHUNK
    assert records == sorted(records, key=lambda r: r.log_time_ns)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_damage_inside_a_chunk_costs_at_most_that_chunk(sound: Path, share: float) -> None:
    index = chunk_indexes(sound)[12]
    records, told = damaged(sound, index.chunk_start_offset + int(share * index.chunk_length))
    lost = set(RECORDS) - set(records)
    assert 0 < len(lost) <= (2 if index.compression == "" else A_CHUNK)
    assert all(index.message_start_time <= r.log_time_ns <= index.message_end_time for r in records if r not in RECORDS)
    assert "used what is sound" in told


@pytest.mark.parametrize("count", [4, 16])
def test_damage_where_the_file_begins_costs_nothing(sound: Path, count: int) -> None:
    records, told = damaged(sound, 0, count)
    assert records == RECORDS
    assert "at byte 0" in told


def test_a_wrong_checksum_alone_costs_nothing(sound: Path) -> None:
    checksum_at = chunk_indexes(sound)[3].chunk_start_offset + 9 + 24
    records, told = damaged(sound, checksum_at, 4)
    assert records == RECORDS
    assert "a wrong checksum" in told


def test_zeros_in_the_middle_cost_what_they_cover(sound: Path) -> None:
    data = bytearray(sound.read_bytes())
    first, last = (chunk_indexes(sound)[number] for number in (10, 15))
    data[first.chunk_start_offset : last.chunk_start_offset] = bytes(last.chunk_start_offset - first.chunk_start_offset)
    for size in (len(data), len(data) - 100):
        sound.write_bytes(data[:size])
        times_ns = [r.log_time_ns for r in open_recording(sound)]
        assert times_ns == [
            r.log_time_ns for r in RECORDS if not first.message_start_time <= r.log_time_ns < last.message_start_time
        ]


def test_damaged_statistics_hide_no_message(sound: Path) -> None:
    whole = sound.read_bytes()
    for at in range(chunk_indexes(sound)[-1].chunk_start_offset + 2_000, len(whole) - 40, 97):
        assert len(damaged(sound, at, 12, seed=at)[0]) >= len(RECORDS) - 2 * A_CHUNK


def test_messages_outside_chunks_are_found_behind_damage(tmp_path: Path) -> None:
    path = tmp_path / "plain.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start("ros2")
        channel = writer.register_channel("/odom", "cdr", writer.register_schema(RECORDS[0].type_name, "ros2msg", b""))
        for n in range(100):
            writer.add_message(channel, 1_000 + n, RECORDS[n].data, 0)
        writer.finish()  # type: ignore[no-untyped-call]
    at = path.read_bytes().find(RECORDS[50].data)
    records, _ = damaged(path, at - 40, 30)
    assert {r.log_time_ns for r in records} >= {*range(1_000, 1_049), *range(1_051, 1_100)}


@pytest.mark.parametrize("linked", [True, False])
def test_of_a_damaged_lz4_frame_what_is_before_the_damage_is_read(linked: bool) -> None:
    content = b"".join(b"%d is one more than %d; " % (n + 1, n) for n in range(20_000))
    frame = lz4.frame.compress(content, block_size=lz4.frame.BLOCKSIZE_MAX64KB, block_linked=linked)
    assert sound_beginning(frame, len(content)) == content
    assert sound_beginning(frame, 1_000) == content[:1_000]
    for at in range(200, len(frame) - 100, len(frame) // 20):
        broken = frame[:at] + bytes(40) + frame[at + 40 :]
        found = sound_beginning(broken, len(content))
        before = int(0.9 * len(content) * at / len(frame)) - 2_000
        assert found[: max(before, 0)] == content[: max(before, 0)]
        if not linked:
            assert found[-1_000:] == content[-1_000:] or at > 0.8 * len(frame)


def test_no_lz4_frame_is_too_broken() -> None:
    frame = lz4.frame.compress(b"abcd" * 3_000)
    for at in range(len(frame)):
        for value in (0, 255):
            broken = bytearray(frame)
            broken[at] = value
            assert len(sound_beginning(bytes(broken), 12_000)) <= 12_000
        assert (b"abcd" * 3_000).startswith(sound_beginning(frame[:at], 12_000))


def test_a_recording_that_is_appended_is_told_with_what_takes_it_out(sound: Path) -> None:
    one = sound.read_bytes()
    sound.write_bytes(one + one)
    recording = open_recording(sound)
    assert list(recording) == RECORDS
    (told,) = recording.warnings
    assert f"tail -c +{len(one) + 1} sound.mcap" in told
    sound.write_bytes(one + bytes(64))
    assert not open_recording(sound).warnings
