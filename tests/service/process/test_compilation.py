"""Nobody takes compiling for a hang: whoever waits is told, once, unless it wants to hear nothing."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from command_line import obey_permissions
from places import ROOT

from wayfi.service.process.compilation import ensure_cache, watch_compilation
from wayfi.service.process.console import Output


def made_up(module: str) -> "numba.core.dispatcher.Dispatcher":
    """A function that is not compiled yet."""

    def one_more(x: float) -> float:
        return x + 1

    one_more.__module__ = module
    return numba.njit(one_more)


def test_a_function_is_told_when_it_is_compiled_and_not_when_it_runs_again() -> None:
    told: list[tuple[int, int]] = []
    function, other = made_up("wayfi.made_up"), made_up("wayfi.made_up")
    with watch_compilation(lambda number, total: told.append((number, total))):
        assert function(1.0) == function(1.0) == 2.0
        function(1)  # of another type, still the same function
        other(1.0)
    made_up("wayfi.made_up")(1.0)
    assert [number for number, _ in told] == [1, 2]
    assert all(total >= number for number, total in told)


def test_functions_of_others_are_not_counted() -> None:
    told: list[int] = []
    with watch_compilation(lambda number, _: told.append(number)):
        made_up("somebody.else")(1.0)
    assert told == []


@pytest.mark.parametrize(("quiet", "as_json"), [(False, False), (True, False), (False, True)])
def test_without_a_terminal_one_line_says_it_unless_told_to_be_quiet(
    quiet: bool, as_json: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    with Output(quiet, as_json).progress("replay"):
        made_up("wayfi.made_up")(1.0)
        made_up("wayfi.made_up")(1.0)
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("once: about half a minute\n") == (0 if quiet or as_json else 1)
    assert printed.err.count("\n") == (0 if quiet or as_json else 1)


def test_an_installation_that_the_user_cannot_write_keeps_its_code_in_the_user_s_cache(tmp_path: Path) -> None:
    site, home = tmp_path / "site" / "wayfi", tmp_path / "home"
    for part in ("service", "frontends", "backend", "recordings"):
        shutil.copytree(ROOT / part, site / part, ignore=shutil.ignore_patterns("__pycache__"))
    for file in (ROOT / "service" / "library").glob("*.py"):
        shutil.copy(file, site)
    folders = [site.parent, site, *(path for path in site.rglob("*") if path.is_dir())]
    for folder in folders:
        folder.chmod(0o555)
    try:
        runs = [_fit_line(site, home) for _ in range(2)]
    finally:
        for folder in folders:
            folder.chmod(0o755)
    assert all(Path(path).is_relative_to(home) for path, _, _ in runs)
    assert [(hits, misses) for _, hits, misses in runs] == [(0, 1), (1, 0)]
    assert not list(site.rglob("*.nb?"))


def _fit_line(site: Path, home: Path) -> tuple[str, int, int]:
    """Where the code of one function is kept, and how often it was found there or not, in a process of its own."""
    code = (
        "import json; from wayfi.frontends.lidar import line_fit as l;"
        "l.fit_line(l.PointSums(5, 1.0, 2.0, 3.0, 4.0, 5.0));"
        "s = l.fit_line.stats;"
        "print(json.dumps([l.__file__, s.cache_path, sum(s.cache_hits.values()), sum(s.cache_misses.values())]))"
    )
    home.mkdir(exist_ok=True)
    kept = {k: v for k, v in os.environ.items() if k not in {"NUMBA_CACHE_DIR", "XDG_CACHE_HOME"}}
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd="/",
        env=kept | {"PYTHONPATH": str(site.parent), "HOME": str(home)},
        preexec_fn=obey_permissions,
        capture_output=True,
        text=True,
        check=True,
    )
    file, cache, hits, misses = json.loads(run.stdout)
    assert file.startswith(str(site))
    return cache, hits, misses


@pytest.mark.parametrize(("sources", "home"), [(False, False), (False, True), (True, False)])
def test_where_code_can_be_kept_nowhere_a_process_keeps_its_own(
    sources: bool, home: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "none" / "yet"))
    monkeypatch.setattr(os, "access", lambda path, _: home if Path(path) == tmp_path else sources)
    ensure_cache()
    if sources or home:
        assert "NUMBA_CACHE_DIR" not in os.environ
    else:
        assert Path(os.environ["NUMBA_CACHE_DIR"]).is_dir()
