"""Recordings: an MCAP file, a folder of rotated parts, or a daemon's run folder, read as one stream of records."""

import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol

from mcap.records import Attachment

from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.mcap.blocks import Block, Record, RecordingError
from wayfi.recordings.mcap.index import McapIndex
from wayfi.recordings.mcap.merging import in_log_time_order
from wayfi.recordings.ros.foreign import convert, converted_channel
from wayfi.recordings.ros.topics import Channel

BLACKBOX_PROFILE = "wayfi-blackbox"
BLACKBOX_PATTERN = "blackbox_*.mcap"
_HASHED_AT_ONCE_BYTES = 1 << 20


class Part(Protocol):
    """One file of a recording. Nothing of its content makes it raise."""

    path: Path
    profile: str
    blocks: list[Block]
    counts: Counter[Channel]

    @property
    def start_ns(self) -> int | None:
        """The first log time; None without messages."""

    @property
    def end_ns(self) -> int | None:
        """The last log time; None without messages."""

    @property
    def warning(self) -> str | None:
        """What was found so far to be missing or damaged, in one line."""

    def records(self, block: Block) -> list[Record]:
        """The messages of `block` in file order."""

    def attachments(self) -> Iterator[Attachment]:
        """The attachments in file order."""


class Recording:
    """The records of `parts`. Iterating reads them block by block, and can be repeated.

    A plain recording is read in log-time order; equal times in the order of the parts and of their files. Messages of
    ROS 1, and those compressed one by one, come as ROS 2's. A daemon's black box is read as it is, in the order it was
    written, which is the order in which its pipeline received the messages. What is sound of damaged files is read.
    """

    def __init__(self, path: Path, parts: Sequence[Part], warnings: list[str]) -> None:
        self.path = path
        self._parts = parts
        self._skipped = warnings

    @property
    def paths(self) -> list[Path]:
        """The files of the recording, in the order of reading."""
        return [part.path for part in self._parts]

    @property
    def is_blackbox(self) -> bool:
        """Whether this is the black box of a daemon."""
        return all(part.profile == BLACKBOX_PROFILE for part in self._parts)

    @property
    def warnings(self) -> list[str]:
        """A line for each file found so far to be cut, damaged or unreadable; complete after the first iteration."""
        return self._skipped + [part.warning for part in self._parts if part.warning is not None]

    @property
    def message_counts(self) -> Mapping[str, int]:
        """The number of messages of each topic, according to the files' statistics."""
        total: Counter[str] = Counter()
        for part in self._parts:
            for channel, count in part.counts.items():
                total[channel.topic] += count
        return total

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels that have messages, sorted."""
        filled = {channel for part in self._parts for channel, count in part.counts.items() if count}
        return tuple(sorted(filled if self.is_blackbox else map(converted_channel, filled)))

    @property
    def message_count(self) -> int:
        """The number of all messages."""
        return sum(self.message_counts.values())

    @property
    def start_ns(self) -> int:
        """The first log time."""
        return min(part.start_ns for part in self._parts if part.start_ns is not None)

    @property
    def end_ns(self) -> int:
        """The last log time."""
        return max(part.end_ns for part in self._parts if part.end_ns is not None)

    @property
    def duration_s(self) -> float:
        """Seconds from the first log time to the last."""
        return (self.end_ns - self.start_ns) / SECOND_NS

    def attachments(self) -> dict[str, bytes]:
        """The attachments by name; the last of several with the same name."""
        return {record.name: record.data for part in self._parts for record in part.attachments()}

    def sha256(self) -> str:
        """The SHA-256 of the concatenated files, in hexadecimal."""
        digest = hashlib.sha256()
        for path in self.paths:
            with path.open("rb") as file:
                while data := file.read(_HASHED_AT_ONCE_BYTES):
                    digest.update(data)
        return digest.hexdigest()

    def __iter__(self) -> Iterator[Record]:
        """The records. Raises RecordingError at the end if none could be read."""
        count = 0
        for record in _in_file_order(self._parts) if self.is_blackbox else self._converted():
            count += 1
            yield record
        if count == 0:
            raise RecordingError(f"{self.path} has no message that can be read: {'; '.join(self.warnings)}")

    def _converted(self) -> Iterator[Record]:
        known: dict[Channel, Channel] = {}
        for record in in_log_time_order(self._parts):
            channel = record.channel
            if channel not in known:
                known[channel] = converted_channel(channel)
            data = convert(record.data, channel)
            same = data is record.data and known[channel] == channel
            yield record if same else Record(*known[channel], record.log_time_ns, data)


def open_recording(path: Path) -> Recording:
    """The recording at `path`: an MCAP file, a folder of parts, or a daemon's run folder.

    An unreadable part of a folder is skipped with a warning. Raises RecordingError if `path` does not exist, is not
    MCAP, or has no messages.
    """
    if not path.exists():
        raise RecordingError(f"{path} does not exist")
    if not path.is_dir():
        return recording_of(path, [path], McapIndex)
    files = list(path.glob(BLACKBOX_PATTERN)) or list(path.glob("*.mcap"))
    if not files:
        raise RecordingError(f"{path} is a folder without .mcap files")
    return recording_of(path, sorted(files, key=natural_order), McapIndex)


def recording_of(
    path: Path, files: Sequence[Path], open_part: Callable[[Path], Part], warnings: Sequence[str] = ()
) -> Recording:
    """The recording at `path` of these parts; one of several that cannot be read is skipped with a warning.

    `warnings` are those that hold before. Raises RecordingError if the only one cannot be read, or nothing is in it.
    """
    parts: list[Part] = []
    warnings = list(warnings)
    for file in files:
        try:
            parts.append(open_part(file))
        except RecordingError as error:
            if len(files) == 1:
                raise
            warnings.append(f"{error}; left out")
    if not any(part.counts for part in parts):
        reasons = "; ".join([*warnings, *(part.warning for part in parts if part.warning is not None)])
        raise RecordingError(f"{path} has no messages{': ' if reasons else ''}{reasons}")
    if not all(part.profile == BLACKBOX_PROFILE for part in parts):
        parts.sort(key=lambda part: part.start_ns or 0)
    return Recording(path, parts, warnings)


def natural_order(path: Path) -> list[tuple[int, str]]:
    """A sort key that puts part_2 before part_10."""
    return [(int(text), "") if text.isdecimal() else (-1, text) for text in re.split(r"(\d+)", path.name)]


def _in_file_order(parts: Sequence[Part]) -> Iterator[Record]:
    for part in parts:
        for block in part.blocks:
            yield from part.records(block)
