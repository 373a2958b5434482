"""`wayfi reproduce`: the paper's method and the streaming service on a recording, in the paper's tables."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.trajectory_scores import absolute_error
from wayfi.service.process.console import Output
from wayfi.service.reproduction import paper_figures
from wayfi.service.reproduction.algorithm1 import NEIGHBOURS, WINDOW, Reproduction, run_algorithm1
from wayfi.service.reproduction.methods import Method
from wayfi.service.reproduction.plots import write_plots
from wayfi.service.reproduction.recorded_drive import RecordedDrive, read_drive
from wayfi.service.reproduction.streaming import StreamingRun, run_streaming, streaming_figures
from wayfi.service.reproduction.sweeps import run_sweeps
from wayfi.service.reproduction.tables import Table, method_table, stage_table, sweep_table, write_tables

NO_LASER = "no laser in the recording: the stages that need it are left out"


def simulate_carpark(out: Path, minutes: float | None, output: Output) -> tuple[Path, Path]:
    """Simulate the paper's car park into `out`; returns the recording and its truth. None `minutes`: full length."""
    out.mkdir(parents=True, exist_ok=True)
    with output.progress("simulate the car park") as progress:
        made = simulate(World.CARPARK, out, minutes=minutes, progress=progress)
    return made.recording, made.truth


def reproduce(recording_path: Path, truth_path: Path, out: Path, output: Output) -> None:
    """Run Algorithm 1 and the streaming service on a recording, and write tables and plots into `out`.

    Raises ReproductionError, RecordingError, TrajectoryError or ScoringError (all WayfiError), and OSError where `out`
    cannot be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    truth = read_tum(truth_path)
    with output.progress(f"read {recording_path}") as progress:
        drive = read_drive(recording_path, progress)
    absolute_error(drive.odometry, truth)  # reports a truth of another drive before the long work
    reproduction = run_algorithm1(drive, output.progress)
    with output.progress("streaming, laser off") as progress:
        laser_off = run_streaming(recording_path, False, progress)
    laser_on = _streaming_with_laser(recording_path, drive, output)
    sweeps = _sweep_tables(drive, reproduction, laser_off, truth, output)
    methods = method_table(
        {method: _ate_m(trajectory, truth) for method, trajectory in reproduction.trajectories.items()},
        _ate_m(laser_off.trajectory, truth),
        _ate_m(laser_on.trajectory, truth) if laser_on else None,
    )
    drive_s = float(drive.odometry.seconds(drive.odometry.stamps_ns[-1:])[0])
    stages = stage_table(reproduction.seconds, (laser_on or laser_off).seconds, drive_s)
    tables = [*sweeps, methods, stages]
    write_tables(out, tables)
    write_plots(out, sweeps, methods, stages, _trajectories(reproduction, laser_off, laser_on), truth)
    _print_tables(output, out, tables, [] if drive.scans else [NO_LASER])


def _streaming_with_laser(recording_path: Path, drive: RecordedDrive, output: Output) -> StreamingRun | None:
    if not drive.scans:
        return None
    with output.progress("streaming, laser on") as progress:
        return run_streaming(recording_path, True, progress)


def _sweep_tables(
    drive: RecordedDrive, reproduction: Reproduction, laser_off: StreamingRun, truth: Trajectory, output: Output
) -> list[Table]:
    with output.progress("other windows and neighbours") as progress:
        by_window, by_neighbours = run_sweeps(drive, reproduction.wifi, truth, progress)
    streaming = streaming_figures(laser_off, truth)
    return [
        sweep_table("w", paper_figures.WINDOWS, by_window, WINDOW, streaming),
        sweep_table("k", paper_figures.NEIGHBOURS, by_neighbours, NEIGHBOURS, streaming),
    ]


def _ate_m(trajectory: Trajectory, truth: Trajectory) -> float:
    return absolute_error(trajectory, truth).error.ate_rmse_m


def _trajectories(
    reproduction: Reproduction, laser_off: StreamingRun, laser_on: StreamingRun | None
) -> Mapping[str, Trajectory]:
    """The trajectories of the plot, by title."""
    shown = {str(method): reproduction.trajectories[method] for method in Method if method in reproduction.trajectories}
    shown["streaming, laser off"] = laser_off.trajectory
    if laser_on:
        shown["streaming, laser on"] = laser_on.trajectory
    return shown


def _print_tables(output: Output, out: Path, tables: list[Table], notes: list[str]) -> None:
    for table in tables:
        output.table(table.title, table.columns, table.rows_as_text())
        output.say("")
    for note in notes:
        output.say(note)
    output.say(f"tables (CSV) and plots: {out}")
    rows = {table.file.removesuffix(".csv"): [asdict(row) for row in table.rows] for table in tables}
    output.result({"out": str(out), "tables": rows, "notes": notes})
