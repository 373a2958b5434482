"""Checkpoints: a drive in a file, from which a killed daemon resumes.

The file is pickled: whoever can write to the run's folder can make the daemon run any code.
"""

import hashlib
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import zstandard

from wayfi.recordings.files.atomic_files import write_bytes

CHECKPOINT = "checkpoint.bin"
MAGIC = b"wayfi checkpoint 2\n"


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """The pickled drive as of the control record of checkpoint `number`."""

    number: int
    drive: bytes


def write_checkpoint(folder: Path, number: int, drive: bytes) -> None:
    """Write a checkpoint into `folder`, in place of the one before. Raises OSError."""
    packed = zstandard.ZstdCompressor(level=1).compress(drive)
    head = MAGIC + f"{number} {_versions()} {hashlib.sha256(packed).hexdigest()}\n".encode()
    write_bytes(folder / CHECKPOINT, head + packed)


def read_checkpoint(folder: Path) -> Checkpoint | None:
    """The checkpoint of `folder`; None without one that is complete and of the same versions of the software."""
    try:
        data = (folder / CHECKPOINT).read_bytes()
    except OSError:
        return None
    head, _, packed = data.removeprefix(MAGIC).partition(b"\n")
    words = head.decode(errors="replace").split()
    if not data.startswith(MAGIC) or len(words) != 3:
        return None
    number, versions, digest = words
    whole = digest == hashlib.sha256(packed).hexdigest() and number.isdecimal()
    if not whole or versions != _versions():
        return None
    return Checkpoint(int(number), zstandard.ZstdDecompressor().decompress(packed))


def _versions() -> str:
    return ",".join(f"{name}={version(name)}" for name in ("wayfi", "gtsam", "numpy", "kiss-icp"))
