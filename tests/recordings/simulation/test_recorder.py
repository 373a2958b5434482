"""Simulated recordings: the same arguments give the same bytes."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from wayfi.frontends.measurements import LaserScan, Odometry, StaticTransforms, WifiScan
from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.robots.models import Robot
from wayfi.recordings.simulation.run import measurements, start
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.service.cli.app import app


@pytest.mark.parametrize("robot", Robot, ids=str)
def test_same_arguments_same_bytes(tmp_path: Path, robot: Robot) -> None:
    first, again = (simulate(World.CARPARK, tmp_path / name, seed=7, minutes=0.2, robot=robot) for name in "ab")
    assert first.recording.read_bytes() == again.recording.read_bytes()
    assert first.truth.read_bytes() == again.truth.read_bytes()


def test_another_seed_is_another_recording(tmp_path: Path) -> None:
    first, other = (simulate(World.CARPARK, tmp_path / str(seed), seed, minutes=0.05) for seed in (1, 2))
    assert first.recording.read_bytes() != other.recording.read_bytes()


OPTIONS = {
    "": Robot.TYPICAL,
    "--rough": Robot.TYPICAL,
    "--ideal": Robot.IDEAL,
    "--robot ideal": Robot.IDEAL,
    "--robot typical": Robot.TYPICAL,
    "--robot cheap": Robot.CHEAP,
}


@pytest.mark.parametrize("options", OPTIONS)
def test_the_command_is_rough_unless_told_otherwise(tmp_path: Path, options: str) -> None:
    arguments = ["simulate", "campus", "--minutes", "0.1", "--quiet", "--out", str(tmp_path / "cli"), *options.split()]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    made = simulate(World.CAMPUS, tmp_path / "made", minutes=0.1, robot=OPTIONS[options])
    assert (tmp_path / "cli" / "recording.mcap").read_bytes() == made.recording.read_bytes()


@pytest.mark.parametrize("options", ["--robot golden", "--robot cheap --rough", "--robot cheap --ideal"])
def test_a_robot_that_is_unknown_or_named_twice_is_a_usage_error(tmp_path: Path, options: str) -> None:
    arguments = ["simulate", "office", "--minutes", "0.1", "--out", str(tmp_path), *options.split()]
    assert CliRunner().invoke(app, arguments).exit_code == 2
    assert list(tmp_path.iterdir()) == []


def test_the_robots_differ(tmp_path: Path) -> None:
    made = [simulate(World.OFFICE, tmp_path / robot, minutes=0.05, robot=robot) for robot in Robot]
    assert len({recording.recording.read_bytes() for recording in made}) == len(Robot)


def test_progress_rises_to_one(tmp_path: Path) -> None:
    fractions: list[float] = []
    simulate(World.OFFICE, tmp_path, minutes=0.1, progress=fractions.append)
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


def test_rates_and_order() -> None:
    received = list(measurements(start(World.CARPARK, 0, 1.0, Robot.IDEAL)))
    stamps = [m.stamp_ns for m in received]
    assert stamps == sorted(stamps)
    assert isinstance(received[0], StaticTransforms)
    assert sum(isinstance(m, Odometry) for m in received) == 601
    assert sum(isinstance(m, LaserScan) for m in received) == 600
    for phone in ("phone_a", "phone_b"):
        assert sum(isinstance(m, WifiScan) and m.receiver == phone for m in received) == 30
