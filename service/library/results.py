"""What a drive has come to: of a `Slam` that has finished, or read from the folder of a replay."""

import json
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from wayfi.frontends.calibration import Calibration
from wayfi.recordings.files.calibration_file import read_calibration
from wayfi.recordings.files.map_folder import copy_map
from wayfi.recordings.files.result_folder import MAP, ResultError, ResultFolder, files_of_a_run, why_not_whole
from wayfi.recordings.files.tables import ClosureRow, read_closures
from wayfi.recordings.files.trinary_grid import TrinaryGrid, read_map
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.trajectory import Trajectory

from .arguments import path_of


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """A whole drive, as believed at its end.

    `trajectory` is the final estimate and `online` what was published on the way, at the same stamps; `closures` has
    one row for each loop candidate with its verdict; `report` is what report.json holds.
    """

    trajectory: Trajectory
    online: Trajectory
    closures: Sequence[ClosureRow]
    grid: TrinaryGrid
    calibration: Calibration
    report: dict[str, Any]
    _write: Callable[[Path], object] = field(repr=False)
    _rrd: Path | None = field(repr=False, default=None)  # the Rerun file of this drive, which may lie anywhere

    def save(self, directory: str | os.PathLike[str]) -> None:
        """Write the files that `wayfi replay` leaves into `directory`, which is made if need be.

        They take the place of those of another drive at once. Raises ResultError where that cannot be done.
        """
        out = path_of(directory, "directory")
        with ResultFolder(out, [self._rrd] if self._rrd else []) as folder:
            self._write(folder.staged)


def load_result(directory: str | os.PathLike[str]) -> Result:
    """The result in the folder of a replay or of `save`.

    Raises WayfiError where a file is missing or is another, and where the run was interrupted.
    """
    folder = path_of(directory, "directory")
    if why := why_not_whole(folder):
        raise ResultError(why)
    return Result(
        read_tum(folder / "trajectory.tum", may_be_empty=True),
        read_tum(folder / "online.tum", may_be_empty=True),
        read_closures(folder / "closures.csv"),
        read_map(folder),
        read_calibration(folder / "calibration.toml"),
        _read_report(folder / "report.json"),
        partial(_copy, folder),
    )


def _copy(folder: Path, out: Path) -> None:
    for file in files_of_a_run(folder):
        shutil.copyfile(file, out / file.name)
    copy_map(folder / MAP, out / MAP)


def _read_report(path: Path) -> dict[str, Any]:
    try:
        report: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ResultError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ResultError(f"{path}: is no report of wayfi: {error}") from None
    return report
