"""Of a cut or damaged file, everything complete is used."""

from pathlib import Path

import pytest
from drives import RESULT_FILES, Simulated, ate_m, lines, run, write
from faulty.faults import LASER_M, replay_refused
from mcap.reader import make_reader


@pytest.fixture(scope="module")
def whole(minute: Simulated, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("whole") / "recording.mcap", minute.arrivals, flush_every=100)


@pytest.mark.parametrize("share", [0.15, 0.5, 0.9, 0.999])
def test_a_cut_file_gives_what_is_complete(whole: Path, tmp_path: Path, share: float) -> None:
    data = whole.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(share * len(data))])
    report = run(cut, tmp_path / "out")
    (warning,) = report["warnings"]
    used = sum(report["messages"].values())
    assert warning == f"cut.mcap is cut off after {used} messages; used what is complete"
    assert used >= (share - 0.1) * 1262
    assert len(lines(tmp_path / "out" / "trajectory.tum")) == report["messages"]["/odom"]
    assert {path.name for path in (tmp_path / "out").iterdir()} >= set(RESULT_FILES) - {"session.rrd"}


@pytest.mark.parametrize("length", [8, 40, 400, 4000])
def test_a_file_cut_before_anything_is_complete(whole: Path, tmp_path: Path, length: int) -> None:
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:length])
    assert "cut.mcap" in replay_refused(tmp_path / "cut.mcap", tmp_path / "out")


def test_a_damaged_chunk_is_left_out(whole: Path, minute: Simulated, tmp_path: Path) -> None:
    data = bytearray(whole.read_bytes())
    with whole.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary
    chunk = summary.chunk_indexes[len(summary.chunk_indexes) // 2]
    data[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0xFF
    (tmp_path / "damaged.mcap").write_bytes(data)
    report = run(tmp_path / "damaged.mcap", tmp_path / "out")
    (warning,) = report["warnings"]
    assert warning.startswith("damaged.mcap is damaged at byte")
    assert sum(report["messages"].values()) == 1262 - 100
    assert ate_m(tmp_path / "out", minute.truth) < LASER_M
