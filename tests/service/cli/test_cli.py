"""The command line: what it lists, what goes to stdout, which exit code, and which setting wins."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
import typer
from conftest import Replayed
from drives import RESULT_FILES, Simulated, cli, write
from typer.main import get_command
from typer.testing import CliRunner, Result

from wayfi.service.cli.app import app
from wayfi.service.config import Config, config_dict

PROMISED = {
    *("demo", "replay", "run", "localize", "view", "evaluate", "simulate", "inspect", "publish", "record", "import"),
    *("reproduce", "config", "warm-up"),
}
SHORT = ("simulate", "office", "--minutes", "0.1", "--out")


def wayfi(*arguments: str | Path) -> Result:
    """`wayfi` with these arguments, in this process."""
    return CliRunner().invoke(app, [str(a) for a in arguments], terminal_width=200)


def commands() -> dict[str, Any]:
    group: Any = get_command(app)
    return dict(group.commands)


@pytest.fixture(scope="module")
def recording(minute: Simulated, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten seconds."""
    first = [a for a in minute.arrivals if a.second <= 10.0]
    return write(tmp_path_factory.mktemp("recording") / "recording.mcap", first)


# What there is


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


# Exit codes


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


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("lidar.enable=false", "lidar.enable: there is no such key"),
        ("laser.enabled=false", "laser: there is no such key"),
        ("lidar.enabled=maybe", "lidar.enabled"),
        ("lidar.icp=3", "lidar.icp: is a section"),
        ("lidar=false", "must read section.key=VALUE"),
        ("lidar.enabled", "must read section.key=VALUE"),
        ("lidar.max_range_m=[1]", "lidar.max_range_m"),
    ],
)
def test_unknown_keys_and_values_that_do_not_fit_exit_with_2_in_one_line(setting: str, said: str) -> None:
    for command in (["config"], ["replay", __file__, "--out", "never_made"]):
        done = wayfi(*command, "--set", setting)
        assert done.exit_code == 2
        assert done.stdout == ""
        (line,) = done.stderr.splitlines()
        assert line.startswith("wayfi: ")
        assert said in line
    assert not Path("never_made").exists()


@pytest.mark.parametrize("text", ["[lidar]\nenable = true\n", "lidar = [", "[lidar]\nmax_range_m = 'far'\n"])
def test_a_broken_configuration_file_exits_with_2(text: str, tmp_path: Path) -> None:
    (tmp_path / "config.toml").write_text(text)
    done = wayfi("config", "--config", tmp_path / "config.toml")
    assert done.exit_code == 2
    assert len(done.stderr.splitlines()) == 1


def test_a_missing_configuration_file_exits_with_2(tmp_path: Path) -> None:
    done = wayfi("config", "--config", tmp_path / "nothing.toml")
    assert done.exit_code == 2
    assert done.stderr == f"wayfi: {tmp_path / 'nothing.toml'}: cannot be read: No such file or directory\n"


def test_what_is_wrong_with_the_world_exits_with_1_in_one_line(recording: Path, tmp_path: Path) -> None:
    (tmp_path / "no_calibration.toml").write_text("[wheels]\n")
    calls: tuple[list[str | Path], ...] = (
        ["replay", recording, "--out", tmp_path / "o", "--calibration", tmp_path / "no_calibration.toml"],
        ["replay", recording, "--out", tmp_path / "o", "--calibration", tmp_path / "nothing.toml"],
        ["inspect", tmp_path / "nothing.mcap"],
        ["inspect", tmp_path / "no_calibration.toml"],
        ["view", tmp_path / "nothing.rrd"],
        ["evaluate", tmp_path / "nothing", "--truth", tmp_path / "nothing.tum"],
    )
    for arguments in calls:
        done = wayfi(*arguments)
        assert done.exit_code == 1, arguments
        assert done.stdout == ""
        (line,) = done.stderr.splitlines()
        assert line.startswith("wayfi: ")


def test_with_json_an_error_is_an_object_too(tmp_path: Path) -> None:
    done = wayfi("replay", tmp_path / "nothing.mcap", "--out", tmp_path, "--json")
    assert done.exit_code == 1
    assert json.loads(done.stdout) == {"error": f"{tmp_path / 'nothing.mcap'} does not exist"}


# What is said


def one_object(done: Result) -> dict[str, Any]:
    """The one JSON object that stdout is."""
    assert done.exit_code == 0, done.output
    assert done.stdout.count("\n") == 1
    value = json.loads(done.stdout)
    assert isinstance(value, dict)
    return value


def test_json_is_one_object_and_nothing_else(recording: Path, carpark_replay: Replayed, tmp_path: Path) -> None:
    made = one_object(wayfi(*SHORT, tmp_path / "office", "--json"))
    assert set(made) == {"recording", "truth", "seconds", "metres", "messages"}
    assert one_object(wayfi("inspect", recording, "--json"))["usable"] is True
    report = one_object(wayfi("replay", recording, "--out", tmp_path / "replay", "--no-rrd", "--json"))
    assert report == json.loads((tmp_path / "replay" / "report.json").read_text())
    assert one_object(wayfi("config", "--json")) == config_dict(Config())
    scores = one_object(
        wayfi("evaluate", copied(carpark_replay.out, tmp_path), "--truth", truth(carpark_replay), "--json")
    )
    assert set(scores) == {"final", "online", "closures", "recall"}


def copied(out: Path, to: Path) -> Path:
    """What `evaluate` reads of a replay, in a folder of its own."""
    folder = to / "copy"
    folder.mkdir()
    for name in ("trajectory.tum", "online.tum", "closures.csv"):
        (folder / name).write_bytes((out / name).read_bytes())
    return folder


def truth(replayed: Replayed) -> Path:
    return replayed.simulated.truth


def test_json_of_a_whole_process_is_one_object(recording: Path, tmp_path: Path) -> None:
    done = cli("replay", recording, "--out", tmp_path, "--json")
    assert done.returncode == 0
    assert done.stdout.count("\n") == 1
    assert set(json.loads(done.stdout)["messages"]) == {"/tf_static", "/odom", "/scan", "/wifi"}
    assert done.stderr == ""


def test_quiet_says_nothing(recording: Path, carpark_replay: Replayed, tmp_path: Path) -> None:
    calls: tuple[list[str | Path], ...] = (
        [*SHORT, tmp_path / "office"],
        ["inspect", recording],
        ["replay", recording, "--out", tmp_path / "replay", "--no-rrd"],
        ["config"],
        ["evaluate", copied(carpark_replay.out, tmp_path), "--truth", truth(carpark_replay)],
    )
    for arguments in calls:
        done = wayfi(*arguments, "--quiet")
        assert (done.exit_code, done.stdout, done.stderr) == (0, "", ""), arguments


def test_a_replay_says_what_it_dropped_and_warns_of(minute: Simulated, tmp_path: Path) -> None:
    first = [a.stamped(100.0) if "Wifi" in type(a.measurement).__name__ else a for a in minute.arrivals if a.second < 5]
    done = wayfi("replay", write(tmp_path / "r.mcap", first), "--out", tmp_path / "out", "--no-rrd")
    assert done.exit_code == 0
    assert "dropped from /wifi: 5 clock_off" in done.stdout


def test_the_demo_makes_scores_and_says_where_to_look(tmp_path: Path) -> None:
    done = cli("demo", "--out", tmp_path / "demo", "--minutes", "0.5")
    assert done.returncode == 0, done.stderr
    assert "absolute trajectory error" in done.stdout
    assert f"wayfi view {tmp_path / 'demo' / 'replay'}" in done.stdout.replace("\n", "")
    assert {path.name for path in (tmp_path / "demo").iterdir()} == {"recording.mcap", "truth.tum", "replay"}
    assert {path.name for path in (tmp_path / "demo" / "replay").iterdir()} >= set(RESULT_FILES)


# The configuration


def keys(values: dict[str, Any]) -> list[tuple[str, ...]]:
    """Every key of a nested mapping, with those it is under."""
    inner = {name: keys(value) if isinstance(value, dict) else [()] for name, value in values.items()}
    return [(name, *key) for name, found in inner.items() for key in found]


def test_config_prints_every_key_with_its_reason_and_parses_back() -> None:
    done = wayfi("config")
    assert done.exit_code == 0
    assert tomllib.loads(done.stdout) == config_dict(Config())
    printed = done.stdout.splitlines()
    settings = [number for number, line in enumerate(printed) if " = " in line and not line.startswith("#")]
    assert len(settings) == len(keys(config_dict(Config()))) > 50
    for number in settings:
        assert printed[number - 1].startswith("# ")
        assert len(printed[number - 1]) > 10


def test_what_config_prints_is_a_configuration_file(tmp_path: Path) -> None:
    (tmp_path / "config.toml").write_text(wayfi("config", "--set", "wifi.enabled=false").stdout)
    again = one_object(wayfi("config", "--config", tmp_path / "config.toml", "--json"))
    assert again == config_dict(Config()) | {"wifi": config_dict(Config().wifi) | {"enabled": False}}


def test_defaults_then_files_in_their_order_then_settings_in_theirs(tmp_path: Path) -> None:
    first, second = tmp_path / "first.toml", tmp_path / "second.toml"
    first.write_text("[lidar]\nmax_range_m = 10.0\nthinning_m = 0.2\nmin_points = 40\n[lidar.trust]\nmost = 50.0\n")
    second.write_text("[lidar]\nthinning_m = 0.3\nmin_points = 50\n")
    files: list[str | Path] = ["--config", first, "--config", second]
    settings = ["--set", "lidar.min_points=60", "--set", "lidar.min_points=70", "--set", "recording.odom=/wheels"]
    values = one_object(wayfi("config", *settings, *files, "--json"))
    lidar = values["lidar"]
    assert (lidar["max_range_m"], lidar["thinning_m"], lidar["min_points"]) == (10.0, 0.3, 70)
    assert lidar["trust"] == config_dict(Config().lidar.trust) | {"most": 50.0}
    assert values["recording"]["odom"] == "/wheels"
    assert values["wifi"] == config_dict(Config().wifi)


def test_typer_shows_no_traceback_of_its_own() -> None:
    assert isinstance(app, typer.Typer)
    assert app.pretty_exceptions_enable is False
