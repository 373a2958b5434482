"""Imports point one way, and estimation knows no transport, file format or viewer."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
TOOL = Path(sys.executable).with_name("lint-imports")
ESTIMATION = sorted([*(ROOT / "backend").glob("*.py"), *(ROOT / "frontends").glob("*.py")])


def test_the_direction_of_imports_holds() -> None:
    if not TOOL.exists():
        pytest.skip("import-linter is not installed beside this Python")
    run = subprocess.run([TOOL, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.parametrize("path", ESTIMATION, ids=[f"{path.parent.name}/{path.name}" for path in ESTIMATION])
def test_estimation_reads_no_clock_and_draws_no_unseeded_number(path: Path) -> None:
    tree = ast.parse(path.read_text())
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    imported |= {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert not imported & {"time", "datetime", "random", "secrets", "uuid", "threading", "asyncio"}
    assert not [n for n in ast.walk(tree) if isinstance(n, ast.Attribute) and n.attr in {"random", "default_rng"}]
