"""`import wayfi` costs nothing until something of it is used."""

import json
import subprocess
import sys

import pytest

import wayfi

HEAVY = {"numpy", "numba", "scipy", "gtsam", "pydantic", "zenoh", "rerun", "matplotlib", "rosbags", "typer", "rich"}
NOT_FOR_A_DRIVE = {"zenoh", "rerun", "matplotlib", "typer"}


def loaded_by(code: str) -> set[str]:
    """The modules that a fresh Python has after `code`."""
    code += "\nimport json, sys\nprint(json.dumps(list(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    return set(json.loads(run.stdout.splitlines()[-1]))


def test_the_import_alone_loads_nothing_heavy() -> None:
    modules = loaded_by("import wayfi\ndir(wayfi)\nwayfi.__version__")
    assert not modules & HEAVY
    assert {name for name in modules if name.startswith("wayfi.")} == set()


def test_a_drive_loads_no_network_viewer_or_plots() -> None:
    assert not loaded_by("import wayfi\nwayfi.Slam().add_odometry(10**18, 0, 0, 0)") & NOT_FOR_A_DRIVE


def test_a_replay_loads_no_network_plots_or_scores() -> None:
    modules = loaded_by("import wayfi.service.cli.run_reports, wayfi.service.replay.replay")
    assert not modules & {"zenoh", "rerun", "matplotlib", "scipy.spatial", "wayfi.service.evaluation.evaluate"}


def test_the_import_is_quick() -> None:
    code = "import time; start = time.perf_counter(); import wayfi; print(time.perf_counter() - start)"
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(3)]
    assert min(float(run.stdout) for run in runs) < 0.5


def test_every_name_is_there_and_listed() -> None:
    assert dir(wayfi) == sorted(wayfi.__all__)
    for name in wayfi.__all__:
        assert getattr(wayfi, name) == getattr(wayfi, name)
    assert wayfi.__version__.count(".") == 2


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'wayfi' has no attribute 'slum'"):
        wayfi.slum  # noqa: B018
