"""The folder of a run: a new one, or that of a run which was not stopped cleanly."""

import fcntl
import os
import time
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from wayfi.backend.errors import WayfiError
from wayfi.frontends.calibration import Calibration
from wayfi.recordings.files.calibration_file import calibration_toml
from wayfi.recordings.files.map_folder import MANIFEST
from wayfi.recordings.files.replaced_together import current
from wayfi.recordings.files.result_folder import MAP
from wayfi.recordings.mcap.parts import BLACKBOX, parts_of
from wayfi.service.blackbox.checkpoint import CHECKPOINT
from wayfi.service.config import Config, config_toml
from wayfi.service.drive.known_map import MapReference

MOST_SERVED = 2  # runs: what the last one saved at its end, nobody may have fetched
RUNNING = "running"  # a file in the folder of a run that has not been stopped: the settings of its drive
IDLE_S = 0.1


class RunFolderError(WayfiError):
    """A folder that cannot be created or written to."""


@dataclass(frozen=True, slots=True)
class RunFolder:
    """A run's folder, locked; `away_s` is for how long nothing of the resumed drive was written, None for a new run."""

    path: Path
    away_s: float | None
    lock: int

    @property
    def resumes(self) -> bool:
        """Whether it holds a drive that is resumed."""
        return self.away_s is not None

    def maps_served(self) -> dict[str, Path]:
        """The maps of this run and of the one before, by the names of the runs; others fetch what is new of them."""
        runs = sorted(path for path in self.path.parent.iterdir() if path.name <= self.path.name)
        mapped = [run for run in runs if current(run / MAP, MANIFEST).exists()]
        return {run.name: run / MAP for run in mapped[-MOST_SERVED:]}

    def mark_stopped(self) -> None:
        """Mark the run as stopped cleanly: delete what a restart would need, and release the lock."""
        (self.path / CHECKPOINT).unlink(missing_ok=True)
        (self.path / RUNNING).unlink(missing_ok=True)
        os.close(self.lock)


def open_run_folder(
    config: Config, calibration: Calibration | None, fresh: bool, known: MapReference | None = None
) -> RunFolder:
    """The newest run's folder if that was not stopped cleanly and has these settings; else, or if `fresh`, a new one.

    Raises RunFolderError.
    """
    directory = Path(config.recording.directory)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        settings = _settings(config, calibration, known)
        found = None if fresh else _unfinished(directory, settings)
        return found or _new(directory, settings)
    except FileExistsError:
        raise RunFolderError(f"{directory}: is no folder; see recording.directory") from None
    except OSError as error:
        where = error.filename or directory
        raise RunFolderError(f"{where}: cannot be written: {error.strerror}; see recording.directory") from None


def _unfinished(directory: Path, settings: str) -> RunFolder | None:
    runs = sorted(path for path in directory.iterdir() if path.is_dir() and parts_of(path, BLACKBOX))
    if not runs or not (runs[-1] / RUNNING).exists():
        return None
    if (runs[-1] / RUNNING).read_text() != settings:
        return None
    lock = _lock(runs[-1])
    if lock is None:
        return None
    away_s = max(0.0, time.time() - max(part.stat().st_mtime for part in parts_of(runs[-1], BLACKBOX)))
    return RunFolder(runs[-1], away_s, lock)


def _new(directory: Path, settings: str) -> RunFolder:
    """A new folder, named by the present second in UTC; waits for the next second where that exists."""
    while True:
        folder = directory / datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
        try:
            folder.mkdir()
        except FileExistsError:
            time.sleep(IDLE_S)
            continue
        (folder / RUNNING).write_text(settings)
        lock = _lock(folder)
        assert lock is not None
        return RunFolder(folder, None, lock)


def _settings(config: Config, calibration: Calibration | None, known: MapReference | None) -> str:
    """All settings that a drive depends on, and its map, as text."""
    plain = Config()
    settings = config_toml(replace(config, zenoh=plain.zenoh, rerun=plain.rerun, recording=plain.recording))
    topics = "\n".join(name for names in config.recording.every_topic.values() for name in names)
    return (
        settings + topics + (calibration_toml(calibration) if calibration else "") + (known.to_json() if known else "")
    )


def _lock(folder: Path) -> int | None:
    """Lock the folder for this process; returns the file descriptor, None where another process holds the lock."""
    file = os.open(folder / RUNNING, os.O_RDWR)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(file)
        return None
    return file
