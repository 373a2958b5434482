"""The disk under the runs: a budget for what is recorded, and room that is left to others."""

import shutil
from pathlib import Path

from wayfi.recordings.mcap.parts import BLACKBOX, SESSION, parts_of

MIB = 1 << 20
KINDS = (BLACKBOX, SESSION)


def free_mb(directory: Path) -> float:
    """How many MiB are free under `directory`. Raises OSError."""
    return shutil.disk_usage(directory).free / MIB


def keep_budget(directory: Path, current: Path, budget_mb: float) -> list[Path]:
    """Delete the oldest recorded parts of the runs in `directory` until they fit; returns what was deleted.

    Of the run in `current` its newest part of each kind stays.
    """
    files = {path: path.stat() for kind in KINDS for path in directory.glob(f"*/{kind[0]}_*{kind[1]}")}
    newest = {path for kind in KINDS for path in parts_of(current, kind)[-1:]}
    over = sum(file.st_size for file in files.values()) - budget_mb * MIB
    deleted = []
    for path in sorted(files.keys() - newest, key=lambda path: (files[path].st_mtime_ns, path)):
        if over <= 0:
            break
        path.unlink()
        over -= files[path].st_size
        deleted.append(path)
    return deleted
