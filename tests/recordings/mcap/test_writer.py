"""Files that are written are what other readers expect; a kill loses only what was not flushed."""

import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_files import put, record, write
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from wayfi.recordings.mcap.blocks import Record, RecordingError
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.messages import ODOMETRY, WIFI_SCAN


def test_the_same_calls_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.mcap", "b.mcap"):
        with McapWriter(tmp_path / name) as writer:
            put(writer, [record(n, n) for n in range(50)])
            writer.attach("config.toml", b"x = 1\n", "application/toml")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_attachments_come_back_and_the_last_of_a_name_wins(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with McapWriter(path) as writer:
        put(writer, [record(1, 1)])
        writer.attach("config.toml", b"x = 0\n", "application/toml")
        writer.attach("config.toml", b"x = 1\n", "application/toml")
        put(writer, [record(2, 2)])
        writer.flush()
        unfinished = path.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(unfinished)
    for file in (path, cut):
        recording = open_recording(file)
        assert recording.attachments() == {"config.toml": b"x = 1\n"}
        assert [r.log_time_ns for r in recording] == [1, 2]


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
    assert list(open_recording(path)) == written


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
from wayfi.recordings.mcap.writer import McapWriter
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


def test_a_place_that_cannot_be_written_is_a_recording_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot write"):
        McapWriter(tmp_path / "missing" / "a.mcap")
