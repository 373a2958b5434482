"""The order of records, rotated parts, black boxes, and what is not a recording."""

import hashlib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_files import numbers, record, write
from places import REAL_DATA

from wayfi.backend.errors import WayfiError
from wayfi.frontends.measurements import Sensor
from wayfi.recordings.mcap.blocks import RecordingError
from wayfi.recordings.mcap.recording import BLACKBOX_PROFILE, open_recording
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR
from wayfi.recordings.ros.topics import Encoding

REAL_COUNTS = {
    "b14test1": {"/odom": 7300, "/wifi": 731},
    "b24test2": {"/odom": 7470, "/wifi": 747},
    "b3test2": {"/odom": 9901, "/wifi": 991},
    "flat_calib3": {"/tf_static": 1, "/odom": 2687, "/scan": 573, "/wifi": 739},
    "intel": {"/tf_static": 1, "/odom": 910, "/scan": 910},
    "intel_wifi": {"/tf_static": 1, "/odom": 910, "/scan": 910, "/wifi": 2651},
}


@settings(deadline=None, max_examples=40)
@given(st.lists(st.integers(0, 30), min_size=1, max_size=60), st.integers(1, 20))
def test_records_come_back_in_log_time_order_equal_times_in_file_order(
    tmp_path_factory: pytest.TempPathFactory, times: list[int], flush_every: int
) -> None:
    records = [record(number, time) for number, time in enumerate(times)]
    path = write(tmp_path_factory.mktemp("order") / "a.mcap", records, flush_every=flush_every)
    expected = sorted(records, key=lambda r: r.log_time_ns)
    assert list(open_recording(path)) == expected
    cut = path.with_name("cut.mcap")
    cut.write_bytes(path.read_bytes()[:-20])
    assert list(open_recording(cut)) == expected


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
