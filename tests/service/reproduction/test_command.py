"""`wayfi reproduce`: its files, its summary, and what is refused."""

import csv
import json
from pathlib import Path
from typing import Any

import pytest
from drives import Replayed, Simulated, ate_m, write
from typer.testing import CliRunner, Result

from wayfi.frontends.measurements import LaserScan, Measurement, WifiScan
from wayfi.recordings.files.tum import read_tum, write_tum
from wayfi.service.cli.app import app
from wayfi.service.reproduction.methods import Method


def wayfi(*arguments: str | Path) -> Result:
    """`wayfi` with these arguments, in this process."""
    return CliRunner().invoke(app, [str(a) for a in arguments], terminal_width=200)


@pytest.mark.parametrize(
    "arguments",
    [("--recording", "r.mcap"), ("--truth", "t.tum"), ("--recording", "r.mcap", "--truth", "t.tum", "--minutes", "2")],
)
def test_half_a_recording_is_wrong_usage(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    assert wayfi("reproduce", "--out", tmp_path / "out", *arguments).exit_code == 2
    assert not (tmp_path / "out").exists()


def written(tmp_path: Path, simulated: Simulated, *without: type[Measurement]) -> tuple[str | Path, ...]:
    """The options that name a simulated recording, left without some of its messages, and its truth."""
    recording = write(tmp_path / "recording.mcap", simulated.without(*without))
    write_tum(tmp_path / "truth.tum", simulated.truth.stamps_ns, simulated.truth.poses)
    return "--recording", recording, "--truth", tmp_path / "truth.tum", "--out", tmp_path / "out"


@pytest.mark.parametrize("flags", [(), ("--json",), ("--quiet",)])
def test_a_recording_without_wifi_is_told_in_one_line(
    minute: Simulated, tmp_path: Path, flags: tuple[str, ...]
) -> None:
    done = wayfi("reproduce", *written(tmp_path, minute, WifiScan), *flags)
    assert done.exit_code == 1
    assert done.stderr.count("\n") == 1
    assert "no WiFi" in done.stderr
    assert ("no WiFi" in json.loads(done.stdout)["error"]) if "--json" in flags else done.stdout == ""


def test_a_truth_of_another_time_is_told_in_one_line(minute: Simulated, tmp_path: Path) -> None:
    options = written(tmp_path, minute)
    write_tum(tmp_path / "truth.tum", minute.truth.stamps_ns + 10**15, minute.truth.poses)
    done = wayfi("reproduce", *options)
    assert (done.exit_code, done.stderr.count("\n")) == (1, 1)
    assert "share no time" in done.stderr


def test_without_a_laser_its_stages_are_left_out_and_that_is_said(minute: Simulated, tmp_path: Path) -> None:
    done = wayfi("reproduce", *written(tmp_path, minute, LaserScan))
    assert done.exit_code == 0, done.stderr
    assert "no laser in the recording" in done.stdout
    methods = csv_rows(tmp_path / "out" / "table_III_methods.csv")
    assert [row["method"] for row in methods] == ["odometry", "GMapping", "similarity model", "WiFi"]
    stages = csv_rows(tmp_path / "out" / "table_IV_time.csv")
    assert [row["stage"] for row in stages] == ["WiFi closures", "first optimisation", "together"]


@pytest.fixture(scope="module")
def reproduced(carpark_replay: Replayed, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The folder and the JSON of a reproduction on six minutes of the car park."""
    out = tmp_path_factory.mktemp("reproduced")
    made = carpark_replay.simulated
    done = wayfi("reproduce", "--recording", made.recording, "--truth", made.truth, "--out", out, "--json")
    assert done.exit_code == 0, done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    return out, result


def csv_rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_tables_and_plots_are_written_and_the_json_says_the_same(reproduced: tuple[Path, dict[str, Any]]) -> None:
    out, result = reproduced
    assert result["out"] == str(out)
    assert result["notes"] == []
    assert set(result["tables"]) == {"table_I_w", "table_II_k", "table_III_methods", "table_IV_time"}
    for name, rows in result["tables"].items():
        told = [["" if value is None else str(value) for value in row.values()] for row in rows]
        assert [list(row.values()) for row in csv_rows(out / f"{name}.csv")] == told
    pictures = {path.name for path in out.glob("*.png") if path.read_bytes().startswith(b"\x89PNG")}
    assert pictures == {"trajectories.png", "closures.png", "methods.png", "time.png"}


def test_a_reproduction_finds_closures_and_scores_every_method(
    reproduced: tuple[Path, dict[str, Any]],
) -> None:
    _, result = reproduced
    by_window = {(row["quantity"], row["setting"]): row["reproduction"] for row in result["tables"]["table_I_w"]}
    assert by_window["closures", "80"] > 50
    assert by_window["position error of a closure, m", "80"] < 3.0
    assert by_window["orientation error of a closure, rad", "80"] < 0.3
    ate = {row["setting"]: row["reproduction"] for row in result["tables"]["table_III_methods"]}
    assert ate["GMapping"] is None
    assert ate["WiFi"] == by_window["ATE of WiFi SLAM, m", "80"]
    assert max(figure for figure in ate.values() if figure is not None) < 10.0


def test_the_streaming_column_is_what_a_replay_gives(
    reproduced: tuple[Path, dict[str, Any]], carpark_replay: Replayed
) -> None:
    _, result = reproduced
    streaming = {row["setting"]: row["streaming"] for row in result["tables"]["table_III_methods"]}
    truth = read_tum(carpark_replay.simulated.truth)
    assert streaming["WiFi + close scans + 40 %"] == pytest.approx(ate_m(carpark_replay.out, truth), abs=1e-6)


def test_without_a_recording_a_car_park_is_simulated(tmp_path: Path) -> None:
    done = wayfi("reproduce", "--minutes", "0.5", "--out", tmp_path / "out", "--quiet")
    assert (done.exit_code, done.stdout) == (0, "")
    methods = csv_rows(tmp_path / "out" / "table_III_methods.csv")
    assert [row["method"] for row in methods] == list(Method)
    assert all(float(row["reproduction"]) < 1.0 for row in methods if row["reproduction"])
    assert (tmp_path / "out" / "recording.mcap").exists()
