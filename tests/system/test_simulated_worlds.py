"""Simulated drives against their truth, with the laser and without, and what the whole car park costs."""

from pathlib import Path

import pytest
from drives import Replayed, replay_by_cli

from wayfi.frontends.events import ClosureKind
from wayfi.recordings.simulation.recorder import SimulatedRecording, simulate
from wayfi.recordings.simulation.robots.models import Robot
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.service.evaluation.evaluate import Evaluation, evaluate

MB = 1e6
WITHOUT_LASER = ("--set", "lidar.enabled=false")
WITHOUT_WIFI = ("--set", "wifi.enabled=false")
WITHOUT_WALLS = ("--set", "lidar.walls.enabled=false")


def scored(made: SimulatedRecording, out: Path) -> tuple[float, float, Evaluation]:
    """The final and the online ATE, m, of a replay, and the whole evaluation."""
    evaluation = evaluate(out, made.truth)
    errors = [score.alignment.error for score in (evaluation.final, evaluation.online)]
    assert [error.not_covered for error in errors] == [0, 0]
    return errors[0].ate_rmse_m, errors[1].ate_rmse_m, evaluation


def assert_precise(evaluation: Evaluation, least: int) -> None:
    """At least so many LiDAR closures are accepted, and hardly one of them is wrong."""
    lidar = evaluation.closures[ClosureKind.LIDAR]
    assert lidar.accepted >= least
    assert lidar.precision is not None
    assert lidar.precision >= 0.97


def test_the_car_park_with_the_laser(carpark_replay: Replayed) -> None:
    final_m, online_m, evaluation = scored(carpark_replay.simulated, carpark_replay.out)
    assert final_m < 0.10
    assert online_m < 0.30
    assert_precise(evaluation, least=5)


def test_the_car_park_without_the_laser(carpark: SimulatedRecording, tmp_path: Path) -> None:
    replay_by_cli(carpark.recording, tmp_path, *WITHOUT_LASER, "--no-rrd")
    final_m, _, evaluation = scored(carpark, tmp_path)
    assert final_m < 1.5
    assert evaluation.closures[ClosureKind.LIDAR].accepted == 0


def test_the_warehouse_with_the_laser(tmp_path: Path) -> None:
    open_racks = 1  # a seed: through them, neighbouring aisles see each other, and loops close in the first minutes
    made = simulate(World.WAREHOUSE, tmp_path / "warehouse", open_racks, minutes=9.0)
    replay_by_cli(made.recording, tmp_path / "out", "--no-rrd")
    final_m, _, evaluation = scored(made, tmp_path / "out")
    assert final_m < 0.15
    assert_precise(evaluation, least=5)


@pytest.mark.slow
def test_the_whole_car_park(tmp_path: Path) -> None:
    made = simulate(World.CARPARK, tmp_path / "carpark")
    report = replay_by_cli(made.recording, tmp_path / "laser")
    final_m, online_m, evaluation = scored(made, tmp_path / "laser")
    assert final_m < 0.30
    assert online_m < 1.0
    assert_precise(evaluation, least=100)
    assert report["peak_memory_mb"] < 1000
    assert (tmp_path / "laser" / "session.rrd").stat().st_size < 300 * MB


@pytest.mark.slow
def test_the_whole_car_park_without_the_laser_where_no_wheel_slips(tmp_path: Path) -> None:
    made = simulate(World.CARPARK, tmp_path / "carpark", robot=Robot.IDEAL)
    replay_by_cli(made.recording, tmp_path / "wifi", *WITHOUT_LASER, "--no-rrd")
    final_m, online_m, evaluation = scored(made, tmp_path / "wifi")
    assert final_m < 1.2
    assert online_m < 6.0
    wifi = evaluation.closures[ClosureKind.WIFI]
    assert wifi.precision is not None
    assert wifi.precision >= 0.95
    assert wifi.nees is not None
    assert 0.5 < wifi.nees < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_wifi_halves_the_error_where_the_laser_sees_two_bare_walls(seed: int, tmp_path: Path) -> None:
    """Halves it where walls are not used as a compass; with both the error is bounded online, too."""
    made = simulate(World.CORRIDOR, tmp_path / "corridor", seed)
    replay_by_cli(made.recording, tmp_path / "both", "--no-rrd")
    replay_by_cli(made.recording, tmp_path / "wifi", *WITHOUT_WALLS, "--no-rrd")
    replay_by_cli(made.recording, tmp_path / "none", *WITHOUT_WIFI, *WITHOUT_WALLS, "--no-rrd")
    both_m, online_m, _ = scored(made, tmp_path / "both")
    (with_m, _, evaluation), (without_m, _, _) = (scored(made, tmp_path / name) for name in ("wifi", "none"))
    assert both_m < 0.45
    assert online_m < 0.55
    assert with_m < 0.6
    assert with_m < 0.5 * without_m
    wifi = evaluation.closures[ClosureKind.WIFI]
    assert wifi.precision is not None
    assert wifi.precision > 0.8  # with seed 1, pairs claim 2 m along the corridor, and a true one may be 3 m off
    assert wifi.nees is not None
    assert wifi.nees < 1.5
    assert evaluation.recall.recall is not None
    assert evaluation.recall.recall > 0.25
