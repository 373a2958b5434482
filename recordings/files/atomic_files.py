"""Files that are either whole or absent: written to a temporary file in the same folder, then renamed."""

import os
from contextlib import suppress
from pathlib import Path


def write_bytes(path: Path, data: bytes) -> None:
    """Write or overwrite `path`; a reader never sees a part of `data`. Raises OSError, which names `path`."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        temporary.write_bytes(data)
        temporary.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8, line ends unchanged, as `write_bytes` does. Raises OSError."""
    write_bytes(path, text.encode())
