"""`wayfi localize`, by files and processes: what it writes and says, and what it refuses."""

import json
import shutil
from pathlib import Path

import pytest
from buildings.localizing import Mapped, errors_m
from buildings.robots import Robot, drive
from buildings.storey import another_building, storey
from command_line import wayfi
from drives import RESULT_FILES, cli, write
from rerun.chunk import RrdReader

from wayfi.recordings.files.tum import read_tum

WAY = ((18.0, 12.5), (24.0, 12.5), (24.0, 7.5), (9.0, 7.5))
ELSEWHERE = ((14.0, 3.0), (19.0, 3.0), (19.0, 8.0), (8.0, 8.0))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("recorded") / "day1.mcap", drive(storey(), WAY, day=1).arrivals)


@pytest.fixture(scope="module")
def out(mapped: Mapped, recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of one localisation by the command, in a process of its own."""
    folder = tmp_path_factory.mktemp("localised") / "out"
    before = contents(mapped.out / "map")
    done = cli("localize", recording, "--map", mapped.out / "map", "--out", folder, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == json.loads((folder / "report.json").read_text())
    assert contents(mapped.out / "map") == before
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def copied(mapped: Mapped, to: Path) -> Path:
    return Path(shutil.copytree(mapped.out / "map", to / "map"))


def refused(recording: Path, map_path: Path, out: Path) -> str:
    """The one line with which the command ends; nothing was written."""
    done = wayfi("localize", recording, "--map", map_path, "--out", out)
    assert done.exit_code == 1, done.output
    assert done.stderr.count("\n") == 1
    assert not out.exists()
    return str(done.stderr)


def test_every_file_but_the_saved_map_is_there(out: Path) -> None:
    assert {path.name for path in out.iterdir()} == set(RESULT_FILES)


def test_only_claimed_poses_are_written_in_the_frame_of_the_map(mapped: Mapped, out: Path) -> None:
    truth = drive(storey(), WAY, day=1).truth
    claimed, report = read_tum(out / "online.tum"), json.loads((out / "report.json").read_text())
    assert errors_m(out / "online.tum", mapped.T_truth_map, truth).max() < 0.3
    assert errors_m(out / "trajectory.tum", mapped.T_truth_map, truth).max() < 0.3
    first = next(change for change in report["status_changes"] if change["state"] == "TRACKING")
    assert 0 < len(claimed) < len(truth)
    assert claimed.stamps_ns[0] * 1e-9 >= first["stamp"] - 1e-6
    assert report["status_changes"][0]["state"] == "RELOCALISING"
    assert report["localization"]["claimed_poses"] == len(claimed)
    assert sum(report["localization"]["seconds"].values()) == pytest.approx(truth.seconds(truth.stamps_ns)[-1], abs=0.5)
    manifest = json.loads((mapped.out / "map" / "manifest.json").read_text())
    assert report["localization"]["map_id"] == manifest["map_id"]


def test_two_processes_claim_the_same_poses(mapped: Mapped, recording: Path, out: Path, tmp_path: Path) -> None:
    done = cli("localize", recording, "--map", mapped.out, "--out", tmp_path / "again", "--no-rrd", "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert not (tmp_path / "again" / "session.rrd").exists()
    for name in ("online.tum", "trajectory.tum", "map.pgm", "graph.g2o"):
        assert (tmp_path / "again" / name).read_bytes() == (out / name).read_bytes(), name


def test_the_log_shows_the_map_the_hypotheses_and_the_robot(out: Path) -> None:
    entities = {chunk.entity_path for chunk in RrdReader(out / "session.rrd").stream().to_chunks()}
    assert entities >= {"/map/grid", "/map/hypotheses", "/map/robot", "/map/ellipse", "/map/scan", "/backend/state"}


def test_a_robot_that_is_somewhere_else_is_told_of_in_words(mapped: Mapped, tmp_path: Path) -> None:
    driven = drive(another_building(), ELSEWHERE, day=1, robot=Robot(mount=None))
    recording = write(tmp_path / "elsewhere.mcap", driven.arrivals)
    done = wayfi("localize", recording, "--map", mapped.out, "--out", tmp_path / "out", "--no-rrd")
    assert done.exit_code == 0, done.output
    assert "never found in the map" in done.stdout
    assert "at the end RELOCALISING: " in done.stdout
    assert (tmp_path / "out" / "online.tum").read_text() == ""


def test_settings_and_calibration_are_taken(mapped: Mapped, recording: Path, tmp_path: Path) -> None:
    options = ("--set", "wifi.enabled=false", "--calibration", mapped.out / "calibration.toml")
    done = wayfi("localize", recording, "--map", mapped.out, "--out", tmp_path / "out", "--no-rrd", "--json", *options)
    assert set(json.loads(done.stdout)["dropped"]["/wifi"]) == {"sensor_off"}
    assert wayfi("localize", recording, "--map", mapped.out, "--out", tmp_path, "--set", "no.such=1").exit_code == 2


def test_a_folder_without_a_map_is_refused(recording: Path, tmp_path: Path) -> None:
    assert "holds no map" in refused(recording, tmp_path, tmp_path / "out")
    assert "holds no map" in refused(recording, tmp_path / "nowhere", tmp_path / "out")


@pytest.mark.parametrize(("version", "said"), [(1, "version 1"), (99, "version 99")])
def test_a_map_of_another_version_is_refused(
    mapped: Mapped, recording: Path, tmp_path: Path, version: int, said: str
) -> None:
    manifest = copied(mapped, tmp_path) / "manifest.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"version": version}))
    assert said in refused(recording, tmp_path / "map", tmp_path / "out")


def test_a_map_without_its_keyframes_is_refused(mapped: Mapped, recording: Path, tmp_path: Path) -> None:
    (copied(mapped, tmp_path) / "keyframes.parquet").unlink()
    assert "keyframes.parquet: is missing" in refused(recording, tmp_path / "map", tmp_path / "out")


def test_a_flipped_byte_of_the_map_is_named_and_the_rest_is_used(
    mapped: Mapped, recording: Path, tmp_path: Path
) -> None:
    damaged = next(copied(mapped, tmp_path).glob("closures*.parquet"))
    data = bytearray(damaged.read_bytes())
    data[len(data) // 2] ^= 1
    damaged.write_bytes(data)
    done = wayfi("localize", recording, "--map", tmp_path / "map", "--out", tmp_path / "out", "--no-rrd")
    assert done.exit_code == 0, done.output
    assert f"warning: {damaged}: was changed since it was written" in done.stdout
    assert "found in the map after" in done.stdout


def test_the_folder_of_the_map_is_not_written_to(mapped: Mapped, recording: Path) -> None:
    before = contents(mapped.out)
    for out in (mapped.out, mapped.out / "map"):
        done = wayfi("localize", recording, "--map", mapped.out, "--out", out)
        assert done.exit_code == 1
        assert "holds the map itself" in done.stderr
    assert contents(mapped.out) == before


def test_a_recording_without_motion_is_refused(mapped: Mapped, tmp_path: Path) -> None:
    silent = write(tmp_path / "silent.mcap", drive(storey(), WAY, day=1).arrivals[:1])
    done = wayfi("localize", silent, "--map", mapped.out, "--out", tmp_path / "out", "--no-rrd")
    assert (done.exit_code, done.stderr.count("\n")) == (1, 1)
    assert "nothing usable on /odom or /scan" in done.stderr
    assert not (tmp_path / "out" / "report.json").exists()
