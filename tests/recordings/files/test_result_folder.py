"""The folder of a run's results holds one run whole, or says that it does not; what is not wayfi's stays."""

import errno
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from wayfi.recordings.files import result_folder
from wayfi.recordings.files.map_folder import MANIFEST, WHOLE_FILES
from wayfi.recordings.files.replaced_together import current
from wayfi.recordings.files.result_folder import (
    EVALUATION,
    PARTIAL,
    RESULTS,
    ResultError,
    ResultFolder,
    note_of_later_run,
    why_not_whole,
)

WRITTEN = (*RESULTS, *(f"map/{name}" for name in (MANIFEST, *WHOLE_FILES, "scans_0000.parquet")))
NOTES = (
    "notes.txt",
    "map/notes.txt",
    "map/keepout.pgm",
    "map/places.parquet",
    "recording.mcap",
    "photo.png",
    "map.pgm.orig",
    "partial/mine.txt",
)


def fill(folder: Path, text: str, names: tuple[str, ...] = WRITTEN) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def contents(folder: Path) -> dict[str, str]:
    return {str(file.relative_to(folder)): file.read_text() for file in folder.rglob("*") if file.is_file()}


def a_run(folder: Path, text: str, kept: tuple[Path, ...] = ()) -> None:
    with ResultFolder(folder, kept) as results:
        fill(results.staged, text, tuple(name for name in WRITTEN if name != "session.rrd"))
        results.log.write_text(text)


def test_a_run_takes_the_place_of_another_with_its_evaluation_and_remains(tmp_path: Path) -> None:
    a_run(tmp_path, "old")
    remains = ("session_0001.rrd", ".map.png.77.part", "map/scans_0077.parquet")
    fill(tmp_path, "old", (*EVALUATION, *remains))
    a_run(tmp_path, "new")
    assert contents(tmp_path) == dict.fromkeys(WRITTEN, "new")
    assert not (tmp_path / PARTIAL).exists()


def test_a_log_that_is_not_written_again_is_not_left(tmp_path: Path) -> None:
    a_run(tmp_path, "old")
    with ResultFolder(tmp_path) as results:
        fill(results.staged, "new", ("report.json", "trajectory.tum"))
    assert contents(tmp_path) == {"report.json": "new", "trajectory.tum": "new"}


def test_what_wayfi_does_not_write_stays_and_so_does_what_is_kept(tmp_path: Path) -> None:
    fill(tmp_path, "mine", NOTES)
    a_run(tmp_path, "old")
    (tmp_path / "session.rrd").write_text("mine")
    with ResultFolder(tmp_path, [tmp_path / "map" / ".." / "session.rrd"]) as results:
        fill(results.staged, "new", ("report.json",))
    assert contents(tmp_path) == {**dict.fromkeys((*NOTES, "session.rrd"), "mine"), "report.json": "new"}


def test_the_parts_of_a_log_stay_beside_their_black_box(tmp_path: Path) -> None:
    own = ("blackbox_0001.mcap", "session_0001.rrd")
    fill(tmp_path, "mine", own)
    a_run(tmp_path, "new")
    assert contents(tmp_path) == {**dict.fromkeys(WRITTEN, "new"), **dict.fromkeys(own, "mine")}


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError, OSError(errno.ENOSPC, "No space left on device")])
def test_an_interrupted_run_leaves_the_old_results_whole(
    error: type[BaseException] | BaseException, tmp_path: Path
) -> None:
    a_run(tmp_path, "old")
    fill(tmp_path, "old", EVALUATION)

    def interrupted() -> None:
        with ResultFolder(tmp_path) as results:
            results.log.write_text("new")
            fill(results.staged, "new", ("trajectory.tum", "map.png"))
            raise error

    with pytest.raises((KeyboardInterrupt, RuntimeError, ResultError)) as raised:
        interrupted()
    if not isinstance(error, OSError):
        assert raised.value.__notes__ == [f"{tmp_path} keeps the results it had"]
    whole = {name: text for name, text in contents(tmp_path).items() if not name.startswith(PARTIAL)}
    assert whole == dict.fromkeys((*WRITTEN, *EVALUATION), "old")
    assert why_not_whole(tmp_path) == ""
    assert "a later run into it was interrupted" in note_of_later_run(tmp_path)
    a_run(tmp_path, "newer")
    assert contents(tmp_path) == dict.fromkeys(WRITTEN, "newer")


def test_an_interrupted_first_run_is_told_and_gives_way_to_the_next(tmp_path: Path) -> None:
    def interrupted() -> None:
        with ResultFolder(tmp_path) as results:
            results.log.write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as raised:
        interrupted()
    assert (tmp_path / "session.rrd").read_text() == "new"
    assert "only part of a run" in why_not_whole(tmp_path)
    assert raised.value.__notes__ == [why_not_whole(tmp_path)]
    with ResultFolder(tmp_path) as results:
        fill(results.staged, "newer", ("report.json",))
    assert contents(tmp_path) == {"report.json": "newer"}


def test_a_run_that_wrote_nothing_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt) as raised, ResultFolder(tmp_path / "out"):
        raise KeyboardInterrupt
    assert list((tmp_path / "out").iterdir()) == []
    assert raised.value.__notes__ == [f"nothing was written to {tmp_path / 'out'}"]


class Killed(BaseException):
    """A kill, at one of the steps of the file system."""


@pytest.mark.parametrize("step", range(2 * len(WRITTEN) + 6))
def test_a_kill_at_any_step_of_the_exchange_leaves_one_run_whole_or_is_told(
    step: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    a_run(tmp_path, "old")
    fill(tmp_path, "old", EVALUATION)
    steps = 0

    def dying(act: Callable[..., object]) -> Callable[..., object]:
        def one(*arguments: object, **named: object) -> object:
            nonlocal steps
            steps += 1
            if steps > step:
                raise Killed
            return act(*arguments, **named)

        return one

    results = ResultFolder(tmp_path)
    fill(results.staged, "new")
    with monkeypatch.context() as patched, suppress(Killed):
        for name in ("unlink", "replace", "rename", "rmdir"):
            patched.setattr(Path, name, dying(getattr(Path, name)))
        results.__exit__(None, None, None)
    found = {text for name, text in contents(tmp_path).items() if not name.startswith((PARTIAL, "map"))}
    saved = {current(tmp_path / "map", name.removeprefix("map/")).read_text() for name in WRITTEN if "/" in name}
    assert why_not_whole(tmp_path) or found | saved in ({"old"}, {"new"})
    assert len(saved) == 1
    a_run(tmp_path, "newer")
    assert contents(tmp_path) == dict.fromkeys(WRITTEN, "newer")


def test_two_runs_do_not_write_into_one_folder(tmp_path: Path) -> None:
    with ResultFolder(tmp_path) as results:
        results.log.write_text("first")
        with pytest.raises(ResultError, match="another run is writing"):
            ResultFolder(tmp_path)
        fill(results.staged, "first", ("report.json",))
    assert contents(tmp_path) == dict.fromkeys(("report.json", "session.rrd"), "first")


def test_a_run_that_ends_as_another_begins_keeps_its_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other finds no results yet, and those of the first a moment later."""
    first = ResultFolder(tmp_path)
    fill(first.staged, "first")
    true_lock = result_folder._lock

    def end_first(folder: Path) -> int:
        monkeypatch.setattr(result_folder, "_lock", true_lock)
        first.__exit__(None, None, None)
        return true_lock(folder)

    monkeypatch.setattr(result_folder, "_lock", end_first)
    with suppress(Killed), ResultFolder(tmp_path):
        assert contents(tmp_path) == dict.fromkeys(WRITTEN, "first")
        raise Killed
    assert contents(tmp_path) == dict.fromkeys(WRITTEN, "first")


@pytest.mark.parametrize("in_the_way", ["", "map", PARTIAL])
def test_a_file_in_the_place_of_a_folder_is_said(in_the_way: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    if in_the_way:
        out.mkdir()
    (out / in_the_way).write_text("mine")
    with pytest.raises(ResultError, match="cannot be made: there is a file"):
        ResultFolder(out)
    assert (out / in_the_way).read_text() == "mine"


@pytest.mark.parametrize("name", ["trajectory.tum", "session.rrd", "map/graph.g2o"])
def test_a_folder_in_the_place_of_a_file_is_said_before_the_run(name: str, tmp_path: Path) -> None:
    (tmp_path / name).mkdir(parents=True)
    with pytest.raises(ResultError, match="there is a folder of this name"):
        ResultFolder(tmp_path)


@pytest.mark.parametrize("out", ["/proc/nowhere/out", "/dev/null/out", "x" * 300])
def test_a_place_that_nothing_can_be_written_to_is_said(out: str) -> None:
    with pytest.raises(ResultError, match=out[:10]):
        ResultFolder(Path(out))


def test_a_process_may_write_one_run_after_another(tmp_path: Path) -> None:
    for text in ("a", "b", "c"):
        a_run(tmp_path, text)
    assert contents(tmp_path) == dict.fromkeys(WRITTEN, "c")
