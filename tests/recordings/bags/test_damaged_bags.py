"""Of a cut or damaged bag, database or log, what is sound is read; no content is more than an error of one line."""

import random
from pathlib import Path

import pytest
from faulty.bags import carmen_log, ros1_bag, rosbag2
from mcap_files import record
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from wayfi.recordings.bags.opening import open_any_recording
from wayfi.recordings.mcap.blocks import Record, RecordingError

RECORDS = [record(n, 1_000_000_000 + 1_000 * n) for n in range(1, 1_001)]


@pytest.fixture(scope="module", params=["db3", "none.bag", "bz2.bag", "lz4.bag", "log", "db3.zstd"])
def sound(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of each kind, of a thousand messages."""
    folder = tmp_path_factory.mktemp("sound")
    if request.param == "log":
        return carmen_log(folder / "a.log", RECORDS)
    if request.param.endswith("bag"):
        return ros1_bag(folder / request.param, RECORDS, request.param.removesuffix(".bag"))
    mode = CompressionMode.FILE if request.param.endswith("zstd") else CompressionMode.NONE
    bag = rosbag2(folder / "bag", RECORDS, StoragePlugin.SQLITE3, mode)
    return next(path for path in bag.iterdir() if ".db3" in path.name)


def read(path: Path) -> tuple[list[Record], list[str]]:
    """The records of a file and what is told; none, and the error, if it is refused."""
    try:
        recording = open_any_recording(path)
        return list(recording), recording.warnings
    except RecordingError as error:
        lines = str(error).splitlines()
        return [], lines


def test_a_sound_one_is_read_whole_and_again(sound: Path) -> None:
    records, warnings = read(sound)
    assert len(records) == len(RECORDS)
    assert warnings == []
    if sound.suffix != ".log":
        assert records == RECORDS


def test_a_cut_one_gives_a_beginning(sound: Path, tmp_path: Path) -> None:
    whole = sound.read_bytes()
    path = tmp_path / sound.name
    counts = []
    for share in (0.3, 0.6, 0.9):
        path.write_bytes(whole[: int(share * len(whole))])
        records, warnings = read(path)
        counts.append(len(records))
        assert len(warnings) == 1
        assert warnings[0].count("cut") + warnings[0].count("damaged") >= 1
    assert counts == sorted(counts)
    if sound.suffix != ".zstd":
        assert counts[-1] > 500


def test_damage_costs_little_and_is_told(sound: Path, tmp_path: Path) -> None:
    whole = bytearray(sound.read_bytes())
    at = int(0.3 * len(whole))
    if sound.name == "none.bag":  # which has no checksums: only what is beside messages can be noticed
        at = whole.find(b"op=\x02", at) - 30
    elif sound.suffix == ".bag":
        at = whole.find(b"op=\x05") + 400
    whole[at : at + 64] = random.Random(0).randbytes(64)
    path = tmp_path / sound.name
    path.write_bytes(whole)
    records, warnings = read(path)
    least = {"none.bag": 997, "bz2.bag": 600, "lz4.bag": 600, "a.log": 998}.get(sound.name, 0)
    assert len(records) >= least
    if sound.suffix != ".db3":  # which has none at all
        assert any("damaged" in line for line in warnings)


def test_no_content_is_more_than_an_error_of_one_line(sound: Path, tmp_path: Path) -> None:
    whole = sound.read_bytes()
    rng = random.Random(1)
    path = tmp_path / sound.name
    for _ in range(25):
        data = bytearray(whole)
        for _ in range(rng.choice((1, 3, 20))):
            at, count = rng.randrange(len(data)), rng.choice((1, 4, 64, 5_000))
            data[at : at + count] = rng.choice((bytes(count), rng.randbytes(count), b"\xff" * count))
        path.write_bytes(data)
        records, _ = read(path)
        assert len(records) <= 2 * len(RECORDS)
