"""`wayfi reproduce`: what its tables hold, what it writes, says and refuses."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Replayed
from drives import SECOND_NS, Simulated, ate_m, write
from typer.testing import CliRunner, Result

from wayfi.backend.pose2 import between_all, compose_all
from wayfi.frontends.measurements import LaserScan, Measurement, WifiScan
from wayfi.recordings.files.tum import read_tum, write_tum
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.cli.app import app
from wayfi.service.reproduction import paper_figures
from wayfi.service.reproduction.methods import Method, Stage
from wayfi.service.reproduction.sweep_figures import SweepFigures, closure_errors
from wayfi.service.reproduction.tables import (
    Row,
    Table,
    figure_text,
    method_table,
    stage_table,
    sweep_table,
    write_tables,
)

# The tables


def test_closures_are_scored_against_the_truth() -> None:
    poses = np.random.default_rng(0).uniform(-3.0, 3.0, (144, 3))
    truth = Trajectory(np.arange(144, dtype=np.int64) * SECOND_NS, poses)
    stamps_ns = truth.stamps_ns[np.array([(0, 100), (5, 60), (7, 90)])]
    true = between_all(truth.at(stamps_ns[:, 0]), truth.at(stamps_ns[:, 1]))
    off = compose_all(true, np.array([[0.3, 0.4, 0.1], [0.0, 1.5, -0.3], [0.0, 0.0, 0.0]]))
    assert closure_errors(stamps_ns, off, truth) == pytest.approx((2.0 / 3, 0.4 / 3))
    claimed = np.array([True, False, True])
    assert closure_errors(stamps_ns, off, truth, claimed) == pytest.approx((2.0 / 3, 0.05))
    assert closure_errors(stamps_ns + 10**15, off, truth) == (None, None)


def three_tables() -> list[Table]:
    figures = {value: SweepFigures(value, 0.125 * value, None, 1 / 3, 2.5) for value in paper_figures.WINDOWS}
    streaming = SweepFigures(7, 0.5, 0.25, None, 0.75)
    seconds = {Stage.WIFI_CLOSURES: 1.5, Stage.FIRST_OPTIMISATION: 0.25, Stage.TWO_FIFTHS: 9.0}
    return [
        sweep_table("w", paper_figures.WINDOWS, figures, 80, streaming),
        method_table({Method.ODOMETRY: 50.0, Method.WIFI: 2.0, Method.TWO_FIFTHS: 1.0}, 0.6, 0.03),
        stage_table(seconds, 4.0, 100.0),
    ]


@pytest.mark.parametrize("number", range(3))
def test_a_csv_holds_every_figure_in_full(tmp_path: Path, number: int) -> None:
    table = three_tables()[number]
    write_tables(tmp_path, [table])
    with (tmp_path / table.file).open(newline="") as file:
        head, *rows = csv.reader(file)
    assert head == table.columns
    read = [Row(*row[:2], *(float(figure) if figure else None for figure in row[2:])) for row in rows]
    assert read == table.rows


def test_the_streaming_service_stands_beside_what_it_is_compared_with() -> None:
    sweep, methods, stages = three_tables()
    beside = {(row.quantity, row.setting): row.streaming for row in sweep.rows if row.streaming is not None}
    assert {setting for _, setting in beside} == {"80"}
    assert beside["closures", "80"] == 7
    assert {row.setting: row.streaming for row in methods.rows if row.streaming is not None} == {
        Method.WIFI: 0.6,
        Method.TWO_FIFTHS: 0.03,
    }
    assert [row.streaming for row in stages.rows] == [None, None, None, 4.0]


def test_the_times_together_are_of_the_stages_that_the_paper_times() -> None:
    together = three_tables()[2].rows[-1]
    assert together.reproduction == 1.5 + 0.25
    assert together.paper == pytest.approx(364.0 + 2.76)


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, ""), (0.0, "0"), (0.0123456, "0.0123"), (2.7, "2.7"), (54.66, "54.7"), (3888.4, "3888"), (396, "396")],
)
def test_a_figure_has_three_digits_or_all_before_the_point(value: float | None, text: str) -> None:
    assert figure_text(value) == text


# The command


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
