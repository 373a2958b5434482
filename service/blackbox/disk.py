"""The disk that holds the runs: a budget for recordings, and the free space."""

import shutil
from pathlib import Path

from wayfi.recordings.mcap.parts import BLACKBOX, SESSION, parts_of

MIB = 1 << 20
KINDS = (BLACKBOX, SESSION)


def free_mb(directory: Path) -> float:
    """The free space of the disk that holds `directory`, MiB. Raises OSError."""
    return shutil.disk_usage(directory).free / MIB


def keep_budget(directory: Path, current: Path, budget_mb: float) -> None:
    """Delete the oldest parts of the runs in `directory` until all fit into `budget_mb` MiB.

    The newest part of each kind in the folder `current` stays. Raises OSError.
    """
    files = {path: path.stat() for kind in KINDS for path in directory.glob(f"*/{kind[0]}_*{kind[1]}")}
    newest = {path for kind in KINDS for path in parts_of(current, kind)[-1:]}
    over = sum(file.st_size for file in files.values()) - budget_mb * MIB
    for path in sorted(files.keys() - newest, key=lambda path: (files[path].st_mtime_ns, path)):
        if over <= 0:
            break
        path.unlink()
        over -= files[path].st_size
