"""Imports point one way, and estimation knows no clock, chance, transport, file format or viewer."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

TOOL = Path(sys.executable).with_name("lint-imports")
ESTIMATION = sorted(path for part in ("backend", "frontends") for path in (ROOT / part).rglob("*.py"))
IMPURE = {
    *("time", "datetime", "calendar", "random", "secrets", "uuid", "threading", "multiprocessing", "asyncio", "os"),
    *("socket", "subprocess", "zenoh", "mcap", "rosbags", "rerun", "pydantic", "typer", "rich", "matplotlib", "PIL"),
}


def impurities(source: str) -> set[str]:
    """The modules that a source imports and numpy's generators that it makes, which no pure function may use."""
    nodes = list(ast.walk(ast.parse(source)))
    imported = {alias.name.partition(".")[0] for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    imported |= {(node.module or "").partition(".")[0] for node in nodes if isinstance(node, ast.ImportFrom)}
    drawn = {node.attr for node in nodes if isinstance(node, ast.Attribute) and node.attr in {"random", "default_rng"}}
    return imported & IMPURE | drawn


def test_the_direction_of_imports_holds() -> None:
    if not TOOL.exists():
        pytest.skip("import-linter is not installed beside this Python")
    run = subprocess.run([TOOL, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.parametrize("path", ESTIMATION, ids=[str(path.relative_to(ROOT)) for path in ESTIMATION])
def test_estimation_reads_no_clock_and_draws_no_unseeded_number(path: Path) -> None:
    assert not impurities(path.read_text())


def test_estimation_is_looked_at_in_its_sub_packages_too() -> None:
    folders = {path.parent.relative_to(ROOT).as_posix() for path in ESTIMATION}
    assert {"backend/graph", "frontends", "frontends/wifi", "frontends/intake"} <= folders


@pytest.mark.parametrize(
    "planted",
    [
        "import time\n",
        "from datetime import datetime\n",
        "import random\n",
        "import zenoh\n",
        "from mcap.writer import Writer\n",
        "import rerun as rr\n",
        "import numpy as np\nx = np.random.rand()\n",
        "from numpy import random\nrng = random.default_rng()\n",
        "def f():\n    import threading\n",
    ],
)
def test_what_is_planted_in_the_estimation_is_found(planted: str) -> None:
    whole = (ROOT / "frontends" / "pipeline.py").read_text()
    assert not impurities(whole)
    assert impurities(whole + planted)
