"""Imports point one way, and estimation knows no clock, chance, file, transport or viewer."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from places import ROOT

TOOL = Path(sys.executable).with_name("lint-imports")
ESTIMATION = sorted(path for part in ("backend", "frontends") for path in (ROOT / part).rglob("*.py"))
PURE = {
    *("array", "bisect", "collections", "contextlib", "copy", "dataclasses", "enum", "heapq", "itertools", "math"),
    *("re", "typing", "gtsam", "numba", "numpy", "kiss_icp.pybind", "wayfi.backend", "wayfi.frontends"),
}
IMPURE_BUILTINS = {
    *("open", "__import__", "eval", "exec", "compile", "input", "print", "breakpoint", "getattr", "globals"),
    "__builtins__",
}
IMPURE_IN_NUMPY = {
    *("random", "default_rng", "datetime64", "datetime_as_string", "load", "loadtxt", "genfromtxt", "fromfile"),
    *("memmap", "DataSource", "save", "savez", "savez_compressed", "savetxt", "tofile"),
}


def impurities(source: str) -> set[str]:
    """What a source imports or names that no pure function may use."""
    nodes = list(ast.walk(ast.parse(source)))
    imported = {name for node in nodes for name in imported_names(node)}
    named = {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}
    attributes = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    impure_imports = {name for name in imported if not is_pure(name)}
    return impure_imports | named & IMPURE_BUILTINS | attributes & IMPURE_IN_NUMPY


def imported_names(node: ast.AST) -> Iterator[str]:
    """The dotted names that an import statement brings in."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        yield from ("." * node.level + f"{node.module or ''}.{alias.name}" for alias in node.names)


def is_pure(name: str) -> bool:
    parts = name.split(".")
    allowed = any(name == pure or name.startswith(pure + ".") for pure in PURE)
    return allowed and "*" not in parts and not (parts[0] == "numpy" and IMPURE_IN_NUMPY & set(parts))


def test_the_direction_of_imports_holds() -> None:
    if not TOOL.exists():
        pytest.skip("import-linter is not installed beside this Python")
    run = subprocess.run([TOOL, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.parametrize("path", ESTIMATION, ids=[str(path.relative_to(ROOT)) for path in ESTIMATION])
def test_estimation_imports_and_names_only_what_is_pure(path: Path) -> None:
    assert not impurities(path.read_text())


def test_estimation_is_looked_at_in_its_sub_packages_too() -> None:
    folders = {path.parent.relative_to(ROOT).as_posix() for path in ESTIMATION}
    assert {"backend/graph", "frontends", "frontends/wifi", "frontends/intake"} <= folders


@pytest.mark.parametrize(
    "planted",
    [
        "import time\n",
        "from time import monotonic as now\n",
        "from datetime import datetime\n",
        "import random\n",
        "import os, math\n",
        "import sys\n",
        "import signal\n",
        "import logging\n",
        "import pathlib\n",
        "from pathlib import Path\n",
        "import importlib\n",
        "from concurrent.futures import ThreadPoolExecutor\n",
        "import concurrent.futures\n",
        "def f():\n    import threading\n",
        "import zenoh\n",
        "from mcap.writer import Writer\n",
        "import rerun as rr\n",
        "import pydantic_settings\n",
        "import scipy\n",
        "import numpy as np\nx = np.random.rand()\n",
        "import numpy.random as r\n",
        "from numpy import random\n",
        "from numpy import random as r\n",
        "from numpy.random import default_rng\n",
        "from numpy.random import rand as r\n",
        "from numpy import *\n",
        "import numpy as np\nx = np.load('f')\n",
        "import numpy as np\nnp.save('f', 1)\n",
        "from numpy import fromfile as f\n",
        "import numpy\nx = numpy.fromfile('f')\n",
        "import numpy as np\nnow = np.datetime64('now')\n",
        "from numpy import datetime64 as d\n",
        "import numpy as np\nx = getattr(np, 'ran' + 'dom')\n",
        "x = open('f')\n",
        "f = open\n",
        "x = __import__('time')\n",
        "x = eval('1')\n",
        "exec('import time')\n",
        "from kiss_icp.config import load_config\n",
        "import kiss_icp\n",
        "from wayfi.service.config import settings\n",
        "from wayfi import recordings\n",
        "import wayfi\n",
        "from . import slam\n",
    ],
)
def test_what_is_planted_in_the_estimation_is_found(planted: str) -> None:
    whole = (ROOT / "frontends" / "pipeline.py").read_text()
    assert not impurities(whole)
    assert impurities(whole + planted)
