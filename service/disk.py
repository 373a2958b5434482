"""The disk under the runs: a budget for what is recorded, and room that is left to others."""

import shutil
from collections.abc import Iterator
from pathlib import Path

MIB = 1 << 20
PARTS = ("blackbox_*.mcap", "session_*.rrd")


def free_mb(directory: Path) -> float:
    """How many MiB are free under `directory`. Raises OSError."""
    return shutil.disk_usage(directory).free / MIB


def keep_budget(directory: Path, current: Path, budget_mb: float) -> list[Path]:
    """Delete the oldest recorded parts of the runs in `directory` until they fit; returns what was deleted.

    Of the run in `current` its newest part of each kind stays.
    """
    deleted = []
    sizes = {path: path.stat().st_size for path in _parts(directory)}
    newest = {max(current.glob(pattern), default=None) for pattern in PARTS}
    over = sum(sizes.values()) - budget_mb * MIB
    for path in sorted(sizes, key=lambda path: (path.parent.name, path.name)):
        if over <= 0:
            break
        if path not in newest:
            path.unlink()
            over -= sizes[path]
            deleted.append(path)
    return deleted


def _parts(directory: Path) -> Iterator[Path]:
    for pattern in PARTS:
        yield from directory.glob(f"*/{pattern}")
