"""What the command line lists, and that a wrong use of any command exits with 2."""

import json
from pathlib import Path
from typing import Any

import pytest
import typer
from command_line import wayfi
from drives import cli
from typer.main import get_command

from wayfi.service.cli.app import app

PROMISED = {
    *("demo", "replay", "run", "localize", "view", "evaluate", "simulate", "inspect", "publish", "record", "import"),
    *("reproduce", "config", "warm-up", "radio", "closures", "merge", "align"),
}


def commands() -> dict[str, Any]:
    group: Any = get_command(app)
    return dict(group.commands)


def test_help_lists_exactly_the_commands_there_are() -> None:
    done = wayfi("--help")
    assert done.exit_code == 0
    listed = [
        line.strip("│ ").split()[0] for line in done.stdout.splitlines() if line.startswith("│ ") and line[2].isalpha()
    ]
    assert set(listed) == set(commands())
    assert set(listed) <= PROMISED
    assert set(listed) >= {"demo", "replay", "evaluate", "simulate", "inspect", "view", "config"}


@pytest.mark.parametrize("name", sorted(PROMISED))
def test_a_command_answers_help_or_does_not_exist(name: str) -> None:
    done = wayfi(name, "--help")
    assert done.exit_code == (0 if name in commands() else 2)


@pytest.mark.parametrize("name", sorted(commands()))
def test_every_command_takes_quiet_and_json_and_explains_every_option(name: str) -> None:
    parameters = commands()[name].params
    assert {"--quiet", "--json"} <= {option for p in parameters for option in p.opts}
    assert commands()[name].help
    assert all(p.help for p in parameters if p.param_type_name == "option" or p.name not in ("directory", "path"))


@pytest.mark.parametrize("name", ["replay", "run", "config", "inspect", "publish", "record"])
def test_every_command_that_configures_takes_files_and_settings(name: str) -> None:
    if name in commands():
        assert {"--config", "--set"} <= {option for p in commands()[name].params for option in p.opts}


def test_the_module_and_the_script_are_the_same_command(recording: Path) -> None:
    done = cli("inspect", recording, "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["usable"] is True
    assert "usage" in cli("--help").stdout.lower()


def test_typer_shows_no_traceback_of_its_own() -> None:
    assert isinstance(app, typer.Typer)
    assert app.pretty_exceptions_enable is False


@pytest.mark.parametrize(
    "arguments",
    [
        ["no-such-command"],
        ["replay"],
        ["replay", "x.mcap"],
        ["replay", "x.mcap", "--out", "o", "--no-such-option"],
        ["replay", "x.mcap", "--out", "o", "--rate", "fast"],
        ["replay", "x.mcap", "--out", "o", "--rate", "0"],
        ["replay", "x.mcap", "--out", "o", "--rate=-1"],
        ["replay", "x.mcap", "--out", "o", "--rate", "nan"],
        ["--quiet", "config"],
        ["simulate", "atlantis", "--out", "o"],
        ["simulate", "office", "--out", "o", "--minutes", "-1"],
        ["simulate", "office", "--out", "o", "--seed", "-1"],
        ["demo", "--minutes", "0"],
        ["evaluate", "o"],
    ],
)
def test_usage_exits_with_2_and_touches_nothing(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = wayfi(*arguments)
    assert done.exit_code == 2
    assert done.stdout == ""
    assert done.stderr
    assert list(tmp_path.iterdir()) == []
