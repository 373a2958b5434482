"""Replays into folders that hold something already, and what does not get to its end or cannot be written."""

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from command_line import obey_permissions
from command_line import wayfi as wayfi_in_process
from drives import RESULT_FILES, Simulated, cli, run, write
from live.loopback import LONG_S

import wayfi
from wayfi.recordings.files.map_folder import files_of_a_map
from wayfi.recordings.files.result_folder import EVALUATION, RESULTS
from wayfi.recordings.files.tum import write_tum
from wayfi.recordings.map.loading import load_map

SETTINGS = ["wifi.enabled=false", "lidar.enabled=false"]  # another run's results, sooner made


@pytest.fixture(scope="module")
def recording(minute: Simulated, tmp_path_factory: pytest.TempPathFactory) -> Path:
    first = [a for a in minute.arrivals if a.second <= 20.0]
    return write(tmp_path_factory.mktemp("recording") / "recording.mcap", first)


@pytest.fixture(scope="module")
def truth(minute: Simulated, recording: Path) -> Path:
    path = recording.with_name("truth.tum")
    write_tum(path, minute.truth.stamps_ns, minute.truth.poses)
    return path


def contents(folder: Path) -> dict[str, bytes]:
    """All files of a folder, without what a later run left in `partial`."""
    files = {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}
    return {name: data for name, data in files.items() if not name.startswith("partial/")}


def beside_the_map(folder: Path) -> set[str]:
    return {name for name in contents(folder) if not name.startswith("map/")}


def test_a_replay_knows_every_file_that_it_writes(recording: Path, tmp_path: Path) -> None:
    run(recording, tmp_path, *SETTINGS, rrd=True)
    files = contents(tmp_path)
    assert {name for name in files if "/" not in name} == set(RESULTS) == set(RESULT_FILES)
    assert {name for name in files if "/" in name} == {f"map/{path.name}" for path in files_of_a_map(tmp_path / "map")}
    assert not load_map(tmp_path).warnings


def test_a_replay_leaves_nothing_of_another_run_and_all_that_is_not_wayfis(
    recording: Path, truth: Path, tmp_path: Path
) -> None:
    out, fresh = tmp_path / "out", tmp_path / "fresh"
    run(recording, out, *SETTINGS, rrd=True)
    assert cli("evaluate", out, "--truth", truth).returncode == 0
    assert beside_the_map(out) == {*RESULTS, *EVALUATION}
    (out / "notes.md").write_text("the day with the open doors")
    (out / "recording.mcap").write_bytes(recording.read_bytes())
    run(out / "recording.mcap", out, "lidar.enabled=false")
    run(recording, fresh, "lidar.enabled=false")
    left = contents(out)
    assert left.pop("notes.md") == b"the day with the open doors"
    assert left.pop("recording.mcap") == recording.read_bytes()
    assert beside_the_map(out) == {*RESULTS, "notes.md", "recording.mcap"} - {"session.rrd"}
    assert {n: d for n, d in left.items() if n != "report.json"} == {
        n: d for n, d in contents(fresh).items() if n != "report.json"
    }


def interrupted(recording: Path, out: Path, sent: signal.Signals, *options: str) -> "subprocess.CompletedProcess[str]":
    """A replay, interrupted when it is under way."""
    command = [sys.executable, "-m", "wayfi.service.cli", "replay", str(recording), "--out", str(out), "--rate", "5"]
    with subprocess.Popen([*command, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not (out / "partial").is_dir():
            time.sleep(0.02)
        time.sleep(2.5)
        process.send_signal(sent)
        said, error = process.communicate(timeout=LONG_S)
    return subprocess.CompletedProcess(command, process.returncode, said, error)


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 130), (signal.SIGKILL, -9)])
def test_an_interrupted_replay_leaves_the_earlier_results_as_they_were(
    sent: signal.Signals, code: int, recording: Path, truth: Path, tmp_path: Path
) -> None:
    run(recording, tmp_path, *SETTINGS, rrd=True)
    before = contents(tmp_path)
    done = interrupted(recording, tmp_path, sent)
    assert (done.returncode, "Traceback" in done.stderr) == (code, False), done.stderr
    if sent != signal.SIGKILL:
        assert done.stderr == f"wayfi: interrupted: {tmp_path} keeps the results it had\n"
    assert contents(tmp_path) == before
    assert len(wayfi.load_result(tmp_path).trajectory) == 201
    if sent == signal.SIGINT:
        assert "a later run into it was interrupted" in cli("evaluate", tmp_path, "--truth", truth).stdout


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_first_replay_is_told_as_partial(
    sent: signal.Signals, recording: Path, truth: Path, tmp_path: Path
) -> None:
    done = interrupted(recording, tmp_path, sent)
    assert done.returncode in (130, -9)
    evaluated = cli("evaluate", tmp_path, "--truth", truth)
    assert (evaluated.returncode, len(evaluated.stderr.splitlines())) == (1, 1)
    assert "holds only part of a run that was interrupted" in evaluated.stderr
    with pytest.raises(wayfi.WayfiError, match="only part of a run"):
        wayfi.load_result(tmp_path)
    run(recording, tmp_path, *SETTINGS)
    assert beside_the_map(tmp_path) == set(RESULTS) - {"session.rrd"}


def small_files(size: int) -> Callable[[], None]:
    """Limits the size of a file that a process may write: then writing fails as on a full disk."""

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    return limit


def started(before: Callable[[], None], *arguments: str | Path) -> "subprocess.CompletedProcess[str]":
    """`wayfi` in a process that calls `before` first."""
    command = [sys.executable, "-m", "wayfi.service.cli", *map(str, arguments)]
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        command, preexec_fn=before, capture_output=True, text=True, env=environment, timeout=LONG_S, check=False
    )


def limited(size: int, *arguments: str | Path) -> "subprocess.CompletedProcess[str]":
    """`wayfi` that cannot write files larger than `size` bytes."""
    return started(small_files(size), *arguments)


def assert_one_line(done: "subprocess.CompletedProcess[str]", named: str) -> None:
    assert (done.returncode, len(done.stderr.splitlines())) == (1, 1), done.stderr
    assert named in done.stderr


@pytest.mark.parametrize(
    ("size", "option", "named"),
    [
        (9_000, "--no-rrd", "partial/trajectory.tum: File too large"),
        (250_000, "--quiet", "session.rrd"),
    ],
)
def test_a_replay_that_cannot_write_says_so_and_leaves_the_earlier_results(
    size: int, option: str, named: str, recording: Path, tmp_path: Path
) -> None:
    run(recording, tmp_path, *SETTINGS)
    before = contents(tmp_path)
    assert_one_line(limited(size, "replay", recording, "--out", tmp_path, "--quiet", option), named)
    assert contents(tmp_path) == before


def test_commands_that_cannot_write_say_which_file(recording: Path, truth: Path, tmp_path: Path) -> None:
    simulated = ["--minutes", "0.5", "--quiet"]
    assert_one_line(limited(90_000, "simulate", "office", "--out", tmp_path / "a", *simulated), "recording.mcap")
    assert_one_line(limited(90_000, "demo", "--out", tmp_path / "b", *simulated), "recording.mcap")
    run(recording, tmp_path / "out", *SETTINGS)
    assert_one_line(limited(900, "evaluate", tmp_path / "out", "--truth", truth, "--quiet"), "evaluation.json")


@pytest.mark.parametrize(
    "arguments",
    [
        ["simulate", "office", "--minutes", "0.2", "--out", "READ_ONLY/a"],
        ["demo", "--minutes", "0.5", "--out", "READ_ONLY/a"],
        ["replay", "RECORDING", "--out", "READ_ONLY", "--no-rrd"],
        ["evaluate", "READ_ONLY", "--truth", "TRUTH"],
        ["record", "--out", "READ_ONLY/a.mcap"],
    ],
    ids=" ".join,
)
def test_a_folder_that_may_not_be_written_is_told_in_one_line(
    arguments: list[str], recording: Path, truth: Path, read_only: Path
) -> None:
    places = {"RECORDING": recording, "TRUTH": truth, "READ_ONLY": read_only}
    for name, place in places.items():
        arguments = [word.replace(name, str(place)) for word in arguments]
    before = contents(read_only)
    assert_one_line(started(obey_permissions, *arguments, "--quiet"), "Permission denied")
    assert contents(read_only) == before


@pytest.fixture(scope="module")
def read_only(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with results that may not be written."""
    out = tmp_path_factory.mktemp("read_only") / "out"
    run(recording, out, *SETTINGS)
    out.chmod(0o555)
    yield out
    out.chmod(0o755)


@pytest.mark.parametrize(
    "arguments",
    [
        ["simulate", "office", "--minutes", "0.2", "--out", "FILE"],
        ["simulate", "office", "--minutes", "0.2", "--out", "/proc/nowhere"],
        ["demo", "--minutes", "0.5", "--out", "FILE/demo"],
        ["record", "--out", "FOLDER"],
        ["record", "--out", "FILE/recording.mcap"],
        ["record", "--out", "/proc/recording.mcap"],
        ["replay", "RECORDING", "--out", "RECORDING"],
        ["import", "RECORDING", "--out", "RECORDING"],
        ["replay", "RECORDING", "--out", "/proc/nowhere"],
        ["replay", "FOLDER", "--out", "FOLDER/out"],
        ["inspect", "FOLDER"],
        ["inspect", "/dev/null"],
        ["reproduce", "--recording", "RECORDING", "--truth", "TRUTH", "--out", "FILE"],
        ["evaluate", "FILE", "--truth", "TRUTH"],
        ["evaluate", "FOLDER", "--truth", "TRUTH"],
        ["evaluate", "FOLDER", "--truth", "FOLDER"],
        ["evaluate", "FOLDER", "--truth", "nowhere.tum"],
        ["evaluate", "FOLDER", "--truth", "/dev/null"],
        ["evaluate", "FOLDER", "--truth", "RECORDING"],
        ["view", "FOLDER"],
        ["view", "FILE"],
    ],
    ids=" ".join,
)
def test_an_odd_place_is_told_in_one_line(arguments: list[str], recording: Path, truth: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder").mkdir()
    places = {"FILE": tmp_path / "file", "FOLDER": tmp_path / "folder", "RECORDING": recording, "TRUTH": truth}
    for name, place in places.items():
        arguments = [word.replace(name, str(place)) for word in arguments]
    before = recording.read_bytes()
    done = wayfi_in_process(*arguments, "--quiet")
    assert isinstance(done.exception, SystemExit)
    assert (done.exit_code, len(done.stderr.splitlines())) == (1, 1), done.stderr
    assert (tmp_path / "file").read_text() == "mine"
    assert recording.read_bytes() == before


@pytest.mark.parametrize("arguments", [["inspect", "RECORDING"], ["inspect", "RECORDING", "--json"], ["config"]])
def test_a_reader_that_has_seen_enough_gives_no_traceback(arguments: list[str], recording: Path) -> None:
    words = [str(recording) if word == "RECORDING" else word for word in arguments]
    command = [sys.executable, "-m", "wayfi.service.cli", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        said = process.stderr.read()
    assert said == ""


def test_the_folder_of_another_black_box_is_refused(recording: Path, tmp_path: Path) -> None:
    (tmp_path / "blackbox_0001.mcap").write_bytes(recording.read_bytes())
    with pytest.raises(wayfi.WayfiError, match="black box of another run"):
        run(recording, tmp_path)
    assert os.listdir(tmp_path) == ["blackbox_0001.mcap"]
