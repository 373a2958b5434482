"""Opens a recording of any kind; what a file is, its first bytes say."""

import re
from collections.abc import Iterator
from pathlib import Path

from mcap.records import Attachment

from wayfi.recordings.bags.carmen import CarmenLog, is_carmen
from wayfi.recordings.bags.ros1_bag import MAGIC as ROS1_MAGIC
from wayfi.recordings.bags.ros1_bag import Ros1Bag
from wayfi.recordings.bags.sqlite_part import MAGIC as SQLITE_MAGIC
from wayfi.recordings.bags.sqlite_part import SqlitePart
from wayfi.recordings.bags.unpacking import Unpacked, opener_of
from wayfi.recordings.mcap.blocks import Block, Record, RecordingError
from wayfi.recordings.mcap.index import McapIndex
from wayfi.recordings.mcap.layout import MAGIC as MCAP_MAGIC
from wayfi.recordings.mcap.recording import (
    BLACKBOX_PATTERN,
    Part,
    Recording,
    natural_order,
    open_recording,
    recording_of,
)

_KINDS = {".mcap": "an MCAP file", ".db3": "a rosbag2 database", ".bag": "a ROS 1 bag of version 2.0"}
_LOGS = {".log": "a CARMEN log", ".clf": "a CARMEN log"}
_PACKED = (".zstd", ".zst", ".gz", ".bz2", ".xz")
_LOOKED_AT_BYTES = 1 << 16
_METADATA = "metadata.yaml"
_NAMED_FILE = re.compile(r"^\s*-\s+[\"']?([^\s\"']+\.(?:db3|mcap)(?:\.zstd)?)[\"']?\s*$", re.MULTILINE)


class UnpackedPart:
    """The part in a file that was compressed as a whole."""

    def __init__(self, path: Path, unpacked: Unpacked, part: Part) -> None:
        self.path = path
        self.profile, self.blocks, self.counts = part.profile, part.blocks, part.counts
        self.start_ns, self.end_ns = part.start_ns, part.end_ns
        self._unpacked = unpacked  # the file is there for as long as this is
        self._part = part

    @property
    def warning(self) -> str | None:
        """What was found so far to be missing or damaged, in one line."""
        return self._unpacked.warning or self._part.warning

    def records(self, block: Block) -> list[Record]:
        """The messages of `block` in file order."""
        return self._part.records(block)

    def attachments(self) -> Iterator[Attachment]:
        """The attachments in file order."""
        return self._part.attachments()


def open_any_recording(path: Path) -> Recording:
    """The recording at `path`: a file or a folder of MCAP, rosbag2 or ROS 1, a CARMEN log, or a daemon's run folder.

    Files may be compressed as a whole. An unreadable part of a folder is skipped with a warning. Raises RecordingError
    if `path` does not exist, is no recording, or has no messages.
    """
    if not path.exists():
        raise RecordingError(f"{path} does not exist")
    if path.name == _METADATA:
        path = path.parent
    if not path.is_dir():
        return recording_of(path, [path], part_of)
    if any(path.glob(BLACKBOX_PATTERN)):
        return open_recording(path)
    return recording_of(path, _files_in(path), part_of, _missing(path))


def part_of(path: Path) -> Part:
    """The part of a recording in the file at `path`. Raises RecordingError if it is none."""
    try:
        opener = opener_of(path)
        if opener is not None:
            unpacked = Unpacked(path, opener)
            return UnpackedPart(path, unpacked, _plain_part(unpacked.path, path))
        return _plain_part(path, path)
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error


def _plain_part(path: Path, given: Path) -> Part:
    with path.open("rb") as file:
        beginning = file.read(_LOOKED_AT_BYTES)
    if beginning.startswith(MCAP_MAGIC) or path.suffix == ".mcap":
        return McapIndex(path)
    if beginning.startswith(SQLITE_MAGIC):
        return SqlitePart(path)
    if beginning.startswith(ROS1_MAGIC):
        return Ros1Bag(path)
    if is_carmen(beginning):
        return CarmenLog(path)
    if not beginning:
        raise RecordingError(f"{given} is empty")
    kinds = {**_KINDS, **_LOGS}
    kind = kinds.get(path.suffix) or f"a recording: {', '.join(_KINDS.values())} or a CARMEN log"
    raise RecordingError(f"{given} is not {kind}")


def _files_in(folder: Path) -> list[Path]:
    """The recordings in a folder, of one kind: there may be another of the same drive beside it."""
    for suffix in _KINDS:
        plain = sorted(folder.glob(f"*{suffix}"), key=natural_order)
        packed = [path for end in _PACKED for path in folder.glob(f"*{suffix}{end}")]
        if plain or packed:
            both = [*plain, *(path for path in packed if path.with_suffix("") not in plain)]
            return sorted(both, key=natural_order)
    raise RecordingError(f"{folder} is a folder without .mcap files, rosbag2 databases or ROS 1 bags")


def _missing(folder: Path) -> list[str]:
    """A line for each file that rosbag2's metadata names and that is not there, packed or not."""
    try:
        named = _NAMED_FILE.findall((folder / _METADATA).read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return []
    there = {path.name.removesuffix(".zstd") for path in folder.iterdir()}
    missing = [name for name in named if Path(name).name.removesuffix(".zstd") not in there]
    return [f"{name}, which metadata.yaml names, is missing" for name in missing]
