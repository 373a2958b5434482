"""The folder of a saved map: the names of its files, and how a new map takes the place of the one before."""

import fcntl
import os
import re
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from wayfi.backend.errors import WayfiError
from wayfi.recordings.files.map_files import GRID_FILES
from wayfi.recordings.files.replaced_together import READY, commit, current, settle

MANIFEST = "manifest.json"
KEYFRAMES, ACCESS_POINTS, GRID = "keyframes.parquet", "access_points.parquet", "grid.parquet"
CALIBRATION, GRAPH = "calibration.toml", "graph.g2o"
EXPORTS = (GRAPH, *GRID_FILES)  # for other programs: the map is loaded without them
WHOLE_FILES = (KEYFRAMES, ACCESS_POINTS, GRID, CALIBRATION, *EXPORTS)
PART = re.compile(
    r"(scans|factors|closures|fingerprints)_\d{4,}\.parquet|grid_floor\d+\.parquet|map_floor\d+\.(pgm|yaml)"
)


class MapError(WayfiError):
    """Files that are no map of wayfi, or a folder that none can be saved in."""


def files_of_a_map(folder: Path) -> list[Path]:
    """The files in `folder` that wayfi writes there for a map, in their places; its manifest first."""
    names = {path.name for place in (folder, folder / READY) for path in place.glob("*") if not path.is_dir()}
    mine = [name for name in sorted(names) if PART.fullmatch(name) or name in WHOLE_FILES]
    return [folder / name for name in ([MANIFEST] if MANIFEST in names else []) + mine]


def replace_map(staged: Path, folder: Path, kept: Collection[str] = ()) -> None:
    """Put the map that `staged` holds in the place of that in `folder`, at once, with `kept` files of the latter.

    Files of the user in `folder` stay. Raises OSError.
    """
    names = {path.name for path in staged.iterdir()} | set(kept)
    commit(staged, folder, MANIFEST)
    delete_map(folder, names)


def delete_map(folder: Path, kept: Collection[str] = ()) -> None:
    """Delete the files of the map in `folder`, but for those `kept`. Raises OSError."""
    for path in files_of_a_map(folder):
        if path.name not in kept:
            path.unlink(missing_ok=True)


def copy_map(folder: Path, out: Path) -> None:
    """Copy the files of the map in `folder`, if there is one, to a new folder `out`. Raises OSError."""
    files = files_of_a_map(folder)
    if files:
        out.mkdir()
    for file in files:
        shutil.copyfile(current(folder, file.name), out / file.name)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Let no other process save a map in `folder`, made if need be, and end what one that was killed had begun.

    Raises MapError where another saves there now, or OSError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    lock = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        settle(folder, MANIFEST)
        yield
    except BlockingIOError:
        raise MapError(f"{folder}: another process is saving a map there; try again when it has ended") from None
    finally:
        os.close(lock)
