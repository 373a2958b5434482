"""What the commands print: words for a person, one JSON object with --json, nothing with --quiet."""

import json
from pathlib import Path

from command_line import copied_replay, one_object, wayfi
from drives import Replayed, Simulated, cli, write

from wayfi.service.config import Config, config_dict

SHORT = ("simulate", "office", "--minutes", "0.1", "--out")


def test_json_is_one_object_and_nothing_else(recording: Path, carpark_replay: Replayed, tmp_path: Path) -> None:
    made = one_object(wayfi(*SHORT, tmp_path / "office", "--json"))
    assert set(made) == {"recording", "truth", "seconds", "metres", "messages"}
    assert one_object(wayfi("inspect", recording, "--json"))["usable"] is True
    report = one_object(wayfi("replay", recording, "--out", tmp_path / "replay", "--no-rrd", "--json"))
    assert report == json.loads((tmp_path / "replay" / "report.json").read_text())
    assert one_object(wayfi("config", "--json")) == config_dict(Config())
    scores = one_object(
        wayfi("evaluate", copied_replay(carpark_replay, tmp_path), "--truth", carpark_replay.simulated.truth, "--json")
    )
    assert set(scores) == {"final", "online", "closures", "recall"}


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
        ["evaluate", copied_replay(carpark_replay, tmp_path), "--truth", carpark_replay.simulated.truth],
    )
    for arguments in calls:
        done = wayfi(*arguments, "--quiet")
        assert (done.exit_code, done.stdout, done.stderr) == (0, "", ""), arguments


def test_a_replay_says_what_it_dropped_and_warns_of(minute: Simulated, tmp_path: Path) -> None:
    first = [a.stamped(100.0) if "Wifi" in type(a.measurement).__name__ else a for a in minute.arrivals if a.second < 5]
    done = wayfi("replay", write(tmp_path / "r.mcap", first), "--out", tmp_path / "out", "--no-rrd")
    assert done.exit_code == 0
    assert "dropped from /wifi: 5 clock_off" in done.stdout
