"""Files that are either whole or absent: written to a temporary file in the same folder, then renamed."""

import csv
import io
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path


def write_bytes(path: Path, data: bytes) -> None:
    """Write or overwrite `path`; a reader never sees a part of `data`. Raises OSError, which names `path`."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with errors_naming(path):
            temporary.write_bytes(data)
            temporary.replace(path)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8, line ends unchanged, as `write_bytes` does. Raises OSError."""
    write_bytes(path, text.encode())


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Iterable[object]]) -> None:
    """Write a table with a header, as `write_bytes` does; None is an empty field. Raises OSError."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    write_text(path, text.getvalue())


@contextmanager
def errors_naming(path: Path) -> Iterator[None]:
    """An OSError within names `path`: that of a full disk names no file by itself."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
