"""Known errors of any command: the exit code and the one line on stderr."""

import json
from pathlib import Path

import pytest
from command_line import copied_replay, wayfi
from drives import Replayed


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


@pytest.mark.parametrize("command", [("simulate", "office"), ("demo",), ("reproduce",)])
def test_an_output_folder_that_cannot_be_made_exits_with_1_in_one_line(
    command: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("in the way")
    out = tmp_path / "file" / "out"
    done = wayfi(*command, "--minutes", "0.5", "--out", out)
    assert done.exit_code == 1
    assert done.stderr == f"wayfi: {out}: Not a directory\n"


def test_an_evaluation_that_cannot_be_written_exits_with_1_in_one_line(
    carpark_replay: Replayed, tmp_path: Path
) -> None:
    replay = copied_replay(carpark_replay, tmp_path)
    (replay / "evaluation.json").mkdir()
    done = wayfi("evaluate", replay, "--truth", carpark_replay.simulated.truth)
    assert done.exit_code == 1
    assert done.stderr == f"wayfi: {replay / 'evaluation.json'}: Is a directory\n"
