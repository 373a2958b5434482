"""What every file of messages without attachments has in common: its blocks, and the times that they span."""

from collections import Counter
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

from mcap.records import Attachment

from wayfi.recordings.mcap.blocks import Block
from wayfi.recordings.ros.topics import Channel


class BagPart:
    """The `blocks` of the file at `path`, and the `counts` of its messages.

    A subclass finds both, before it is asked for its times.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.blocks: list[Block] = []
        self.counts: Counter[Channel] = Counter()

    @cached_property
    def start_ns(self) -> int | None:
        """The first log time; None without messages."""
        return min((block.start_ns for block in self.blocks), default=None)

    @cached_property
    def end_ns(self) -> int | None:
        """The last log time; None without messages."""
        return max((block.end_ns for block in self.blocks), default=None)

    def attachments(self) -> Iterator[Attachment]:
        """None: such a file has no attachments."""
        return iter(())
