"""A daemon that is driven again and again does not grow; the hour is benchmarks/soak.py's."""

from pathlib import Path

import pytest
from benchmarks.soak import GROWTH_MB, Soak, growth_mb

from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.worlds.blueprints import World

DRIVES = 5


@pytest.mark.slow
def test_a_daemon_that_is_driven_again_and_again_stays_small(tmp_path: Path) -> None:
    recording = simulate(World.CARPARK, tmp_path / "drive", minutes=0.5).recording
    soak = Soak(tmp_path)
    assert soak.run(recording, minutes=10.0, rate=20.0, drives=DRIVES) == 0
    assert {look.drive for look in soak.looks} == set(range(1, DRIVES + 1))
    assert all(look.daemon_mb > 50 and look.estimation_mb > 50 for look in soak.looks)
    assert growth_mb(soak.looks) < GROWTH_MB
