"""Files that are compressed as a whole: by rosbag2 (.zstd), or by whoever keeps them (.gz, .bz2, .xz)."""

import bz2
import gzip
import lzma
import shutil
import tempfile
import weakref
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, Literal

import zstandard

from wayfi.recordings.mcap.blocks import RecordingError

Opener = Callable[[Path, Literal["rb"]], Any]
_OPENERS: dict[bytes, Opener] = {
    b"\x28\xb5\x2f\xfd": zstandard.open,
    b"\x1f\x8b": gzip.open,
    b"BZh": bz2.open,
    b"\xfd7zXZ\0": lzma.open,
}
_FAULTS = (zstandard.ZstdError, EOFError, lzma.LZMAError, zlib.error, gzip.BadGzipFile)
_COPIED_AT_ONCE_BYTES = 1 << 16


class Unpacked:
    """The content of the compressed file at `source`, in a temporary file that goes when this object does.

    `warning` says where it is damaged or cut off. Raises RecordingError if nothing comes of it.
    """

    def __init__(self, source: Path, opener: Opener) -> None:
        self.warning: str | None = None
        folder = tempfile.mkdtemp(prefix="wayfi-")
        self._finalizer = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self.path = Path(folder) / source.stem
        try:
            with opener(source, "rb") as packed, self.path.open("wb") as file:
                self._copy(packed, file, source)
        except OSError as error:
            raise RecordingError(f"cannot unpack {source}: {error.strerror or error}") from error
        if self.path.stat().st_size == 0:
            raise RecordingError(f"{source} is empty, or nothing of it can be unpacked")

    def _copy(self, packed: IO[bytes], file: IO[bytes], source: Path) -> None:
        try:
            while data := packed.read(_COPIED_AT_ONCE_BYTES):
                file.write(data)
        except _FAULTS as fault:
            self.warning = f"{source.name} is damaged or cut off ({str(fault).lower()}); used what comes before"


def opener_of(path: Path) -> Opener | None:
    """What opens the compressed file at `path`; None if it is not compressed. Raises OSError."""
    with path.open("rb") as file:
        beginning = file.read(8)
    return next((opener for magic, opener in _OPENERS.items() if beginning.startswith(magic)), None)
