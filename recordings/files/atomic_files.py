"""Files that are either whole or not there: written beside their place, then renamed into it."""

import os
from pathlib import Path


def write_bytes(path: Path, data: bytes) -> None:
    """Puts `data` at `path`, in the place of what was there; a reader never sees half of it."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        temporary.write_bytes(data)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Puts `text` at `path` as UTF-8, its line ends as they are."""
    write_bytes(path, text.encode())
