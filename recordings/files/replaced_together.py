"""Files of a folder that are replaced together: the new ones are made ready in a folder within, one rename commits.

From then on they count, wherever they lie: in `.ready`, until they are moved to their places, or there. A process that
is killed at any moment leaves all of the former files or all of the new ones.
"""

import os
from contextlib import suppress
from pathlib import Path

READY = ".ready"
ATTEMPTS = 3  # to read a file: it is moved once, and another time by the next save


def commit(staged: Path, folder: Path, last: str) -> None:
    """Replace files of `folder` by those of `staged`, on one file system, at once; `last` is moved to its place last.

    What was committed before has to be settled. Raises OSError.
    """
    for file in staged.iterdir():
        _flush(file)
    _flush(staged)
    staged.rename(folder / READY)
    _flush(folder)
    settle(folder, last)


def settle(folder: Path, last: str) -> None:
    """Move the files that are committed to their places, as a process that was killed did not. Raises OSError."""
    ready = folder / READY
    if not ready.is_dir():
        return
    for file in sorted(ready.iterdir(), key=lambda file: file.name == last):
        file.replace(folder / file.name)
    _flush(folder)
    ready.rmdir()


def current(folder: Path, name: str) -> Path:
    """Where the file `name` of a folder lies, which may be moved to its place meanwhile."""
    ready = folder / READY / name
    return ready if ready.exists() else folder / name


def read_current(folder: Path, name: str) -> bytes:
    """The bytes of the file `name` of a folder, also where it is moved to its place meanwhile. Raises OSError."""
    for _ in range(ATTEMPTS):
        with suppress(FileNotFoundError):
            return current(folder, name).read_bytes()
    return (folder / name).read_bytes()


def _flush(path: Path) -> None:
    """Have the disk keep what was written to a file, or the names in a folder: they outlast a loss of power."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        with suppress(OSError):  # some file systems flush no folders
            os.fsync(descriptor)
    finally:
        os.close(descriptor)
