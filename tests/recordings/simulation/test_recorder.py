"""Simulated recordings: the same arguments give the same bytes."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from wayfi.frontends.measurements import LaserScan, Odometry, StaticTransforms, WifiScan
from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.run import measurements, start
from wayfi.recordings.simulation.worlds import World
from wayfi.service.cli.app import app


@pytest.mark.parametrize("rough", [True, False])
def test_same_arguments_same_bytes(tmp_path: Path, rough: bool) -> None:
    first, again = (simulate(World.CARPARK, tmp_path / name, seed=7, minutes=0.2, rough=rough) for name in "ab")
    assert first.recording.read_bytes() == again.recording.read_bytes()
    assert first.truth.read_bytes() == again.truth.read_bytes()


def test_another_seed_is_another_recording(tmp_path: Path) -> None:
    first, other = (simulate(World.CARPARK, tmp_path / str(seed), seed, minutes=0.05) for seed in (1, 2))
    assert first.recording.read_bytes() != other.recording.read_bytes()


@pytest.mark.parametrize(("options", "rough"), [([], True), (["--rough"], True), (["--ideal"], False)], ids=str)
def test_the_command_is_rough_unless_told_otherwise(tmp_path: Path, options: list[str], rough: bool) -> None:
    arguments = ["simulate", "campus", "--minutes", "0.1", "--quiet", "--out", str(tmp_path / "cli"), *options]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    made = simulate(World.CAMPUS, tmp_path / "made", minutes=0.1, rough=rough)
    assert (tmp_path / "cli" / "recording.mcap").read_bytes() == made.recording.read_bytes()


def test_rough_and_ideal_differ(tmp_path: Path) -> None:
    rough, ideal = (simulate(World.OFFICE, tmp_path / str(r), minutes=0.05, rough=r) for r in (True, False))
    assert rough.recording.read_bytes() != ideal.recording.read_bytes()


def test_progress_rises_to_one(tmp_path: Path) -> None:
    fractions: list[float] = []
    simulate(World.OFFICE, tmp_path, minutes=0.1, progress=fractions.append)
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


def test_rates_and_order() -> None:
    received = list(measurements(start(World.CARPARK, 0, minutes=1.0)))
    stamps = [m.stamp_ns for m in received]
    assert stamps == sorted(stamps)
    assert isinstance(received[0], StaticTransforms)
    assert sum(isinstance(m, Odometry) for m in received) == 601
    assert sum(isinstance(m, LaserScan) for m in received) == 600
    for phone in ("phone_a", "phone_b"):
        assert sum(isinstance(m, WifiScan) and m.receiver == phone for m in received) == 30
