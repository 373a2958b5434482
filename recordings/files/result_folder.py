"""The folder of a run's results: it holds one run whole, or tells that it does not."""

import fcntl
import os
import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from wayfi.backend.errors import WayfiError
from wayfi.recordings.files.map_folder import (
    MANIFEST,
    WHOLE_FILES,
    delete_map,
    files_of_a_map,
    locked,
    replace_map,
)
from wayfi.recordings.mcap.parts import BLACKBOX, SESSION, parts_of

PARTIAL = "partial"  # a folder beside the results, as long as new ones are not whole
REPORT, LOG = "report.json", "session.rrd"
MAP = "map"  # the folder of the saved map within
RESULTS = (
    *("trajectory.tum", "online.tum", LOG, "closures.csv", "map.pgm", "map.yaml", "map.png", "graph.g2o", "radio.csv"),
    *("config.toml", "calibration.toml", REPORT),
)
FLOOR = re.compile(r"map_floor\d+\.(pgm|yaml|png)")
EVALUATION = ("evaluation.json", "evaluation_trajectory.png", "evaluation_error.png")


class ResultError(WayfiError):
    """A folder that results cannot be written to, or that holds none that are whole."""


class ResultFolder:
    """The folder `path`, made if need be; new results are staged in `partial`, and take the place of the old at once.

    A context manager: they do so where it ends without an exception. Until then earlier results stay whole, and the map
    in it is whole at every moment; an exception gets a note of what the folder holds. An interrupted run leaves
    `partial` behind; results are whole where there is a report.json. Only files that wayfi writes are deleted, and none
    that are `kept`. The Rerun file goes to `log`: beside the results where there are none yet, so that it can be looked
    at on the way. Raises ResultError where the folder cannot be written, something is in the way, or another process
    writes there.
    """

    def __init__(self, path: Path, kept: Iterable[Path] = ()) -> None:
        self.path, self.staged = path, path / PARTIAL
        self._kept = {each.resolve() for each in kept}
        try:
            _refuse_obstacles(path)
            path.mkdir(parents=True, exist_ok=True)
            self._lock = _lock(path)
            self._begin()
        except OSError as error:
            raise ResultError(f"{error.filename or path}: cannot be written: {error.strerror}") from None
        is_first = not self._old()
        self.log = (path if is_first else self.staged) / LOG
        if is_first:
            self._kept.add(self.log.resolve())

    def _begin(self) -> None:
        """Delete what an interrupted run has left; only whoever has the lock can tell that it was one."""
        try:
            was_interrupted = bool(why_not_whole(self.path))
            self.staged.mkdir(exist_ok=True)
            _delete(files_of_a_run(self.staged))
            if was_interrupted:
                _delete(self._old())
        except OSError:
            os.close(self._lock)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is None:
                self._adopt()
            if error is None or not (files_of_a_run(self.staged) or self.log.exists()):
                self._remove_staged()
        except OSError as failure:
            error = failure
        finally:
            os.close(self._lock)
        if isinstance(error, OSError):
            raise ResultError(f"{error.filename or self.path}: {error.strerror or error}") from None
        if error is not None:
            error.add_note(self._holds())

    def _adopt(self) -> None:
        """Put the staged files in the place of the old ones, the map after the others and the report last."""
        staged, final = self.staged / MAP, self.path / MAP
        with locked(final):
            (self.path / REPORT).unlink(missing_ok=True)
            _delete(self._old())
            self._move(lambda file: file.name != REPORT)
            replace_map(staged, final) if files_of_a_map(staged) else delete_map(final)
            self._move(lambda file: file.name == REPORT)

    def _move(self, meant: Callable[[Path], bool]) -> None:
        """Move the staged files that are `meant` to their places."""
        for file in filter(meant, files_of_a_run(self.staged)):
            file.replace(self.path / file.name)

    def _holds(self) -> str:
        if (self.path / REPORT).exists():
            return f"{self.path} keeps the results it had"
        return why_not_whole(self.path) or f"nothing was written to {self.path}"

    def _old(self) -> list[Path]:
        return [file for file in files_of_a_run(self.path) if file.resolve() not in self._kept]

    def _remove_staged(self) -> None:
        """Remove `partial`, unless it holds files that wayfi did not write, and a map's folder that is empty."""
        for folder in (self.path / MAP, self.staged / MAP, self.staged):
            with suppress(OSError):
                folder.rmdir()


def files_of_a_run(folder: Path) -> list[Path]:
    """The files in `folder` that wayfi writes there: results, evaluation, and what is left of files half written.

    The parts of a daemon's log count, except beside its black box. Those of the map within are not among them.
    """
    floors = sorted(file for file in folder.glob("map_floor*") if FLOOR.fullmatch(file.name))
    known = [*(folder / name for name in (*RESULTS, *EVALUATION)), *floors]
    files = [file for file in known if file.is_file() or file.is_symlink()]
    half_written = [half for file in known for half in file.parent.glob(f".{file.name}.*.part")]
    parts = [] if parts_of(folder, BLACKBOX) else parts_of(folder, SESSION)
    return [*files, *half_written, *parts]


def why_not_whole(folder: Path) -> str:
    """Why the results in `folder` are not those of one run that went to its end; empty where they may be."""
    if (folder / PARTIAL).is_dir() and not (folder / REPORT).exists():
        return f"{folder} holds only part of a run that was interrupted: replay again"
    return ""


def note_of_later_run(folder: Path) -> str:
    """A line that a later run than that of the results in `folder` was interrupted; empty where none was."""
    if (folder / PARTIAL).is_dir() and (folder / REPORT).exists():
        return f"{folder}: a later run into it was interrupted; these are the results of the one before"
    return ""


def _refuse_obstacles(path: Path) -> None:
    """Raise ResultError where a file is in the place of a folder, or a folder in that of a file."""
    for folder in (path, path / MAP, path / PARTIAL):
        if folder.exists() and not folder.is_dir():
            raise ResultError(f"{folder}: cannot be made: there is a file of this name")
    for name in (*RESULTS, *(f"{MAP}/{name}" for name in (MANIFEST, *WHOLE_FILES))):
        if (path / name).is_dir():
            raise ResultError(f"{path / name}: cannot be written: there is a folder of this name")


def _lock(folder: Path) -> int:
    """Lock `folder` for this process; returns the file descriptor. Raises ResultError where another has it."""
    lock = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        raise ResultError(
            f"{folder}: another run is writing its results there; wait for its end, or name another folder"
        ) from None
    return lock


def _delete(files: Iterable[Path]) -> None:
    for file in files:
        file.unlink(missing_ok=True)
