"""After the warm-up nothing is left to be compiled, and it compiles nothing twice."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from drives import Arrival, Simulated, write

from wayfi.recordings.simulation.run import start
from wayfi.recordings.simulation.spatial import spatial_measurements
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.service.drive.warm_up import warm_up
from wayfi.service.process.compilation import watch_compilation


def wayfi(cache: Path, *arguments: str | Path) -> "subprocess.CompletedProcess[str]":
    """`wayfi` with its compiled code in `cache`."""
    command = [sys.executable, "-m", "wayfi.service.cli", *map(str, arguments)]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=500, check=True)


def test_it_is_done_once_in_a_process() -> None:
    warm_up()
    told: list[int] = []
    with watch_compilation(lambda number, _: told.append(number)):
        warm_up()
    assert told == []
    assert warm_up.cache_info().hits > 0


def test_a_drive_that_begins_in_a_map_finds_the_code_of_its_search_loaded() -> None:
    code = """
from wayfi.frontends.localization import branch_and_bound, place_field, refining
from wayfi.service.drive.warm_up import warm_up
warm_up(in_map=True)
functions = [f for module in (branch_and_bound, place_field, refining) for f in vars(module).values()]
searched = {f.py_func.__name__: len(f.signatures) for f in functions if hasattr(f, "py_func")}
import json; print(json.dumps(searched))
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=500, check=True)
    loaded = json.loads(run.stdout.splitlines()[-1])
    for name in ("_is_near_wall", "_mark", "_blur", "_pooled", "_mark_free", "cells_at", "advance"):
        assert loaded[name] == 1, name


@pytest.mark.slow
def test_a_new_installation_compiles_once_says_so_and_leaves_nothing_for_a_drive(
    minute: Simulated, tmp_path: Path
) -> None:
    first, second = (wayfi(tmp_path / "cache", "warm-up") for _ in range(2))
    assert "functions compiled in" in first.stdout
    assert first.stderr.startswith("compiling ")
    assert (second.stdout, second.stderr) == ("everything is compiled already\n", "")
    assert json.loads(wayfi(tmp_path / "cache", "warm-up", "--json").stdout)["compiled"] == 0
    spatial = [Arrival(m.stamp_ns, m) for m in spatial_measurements(start(World.CARPARK, 0, 0.3))]
    for name, arrivals in (("planar", minute.arrivals), ("spatial", spatial)):
        recording = write(tmp_path / f"{name}.mcap", arrivals)
        replayed = wayfi(tmp_path / "cache", "replay", recording, "--out", tmp_path / name, "--no-rrd")
        assert "compiling" not in replayed.stderr
