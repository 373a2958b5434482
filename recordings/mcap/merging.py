"""The records of many blocks in log-time order."""

import heapq
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Protocol

from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.mcap.blocks import Block, Record

_UNSET_IF_LATER_NS = 365 * 86_400 * SECOND_NS  # simulated time, which begins at 0, does not come so far

Timed = tuple[int, Record]


class Blocks(Protocol):
    """Blocks of records, in the order of the file, and the latest of their log times."""

    blocks: list[Block]

    @property
    def end_ns(self) -> int | None:
        """The last log time; None without messages."""

    def records(self, block: Block) -> list[Record]:
        """The messages of `block` in file order."""


def in_log_time_order(parts: Sequence[Blocks]) -> Iterator[Record]:
    """Merge the blocks by log time; equal times in file order. Only blocks that overlap in time are in memory together.

    A log time of 0 in a file of much later ones was never set: such a message keeps its place in the file.
    """
    waiting = deque(sorted(_starts(parts), key=lambda start: start[:3]))
    merging: list[tuple[int, int, int, int, list[Timed]]] = []
    while waiting or merging:
        while waiting and (not merging or waiting[0][:3] <= merging[0][:3]):
            start_ns, number, offset, block = waiting.popleft()
            records = _timed(parts[number].records(block), start_ns, _has_unset(parts[number]))
            if records:
                heapq.heappush(merging, (records[0][0], number, offset, 0, records))
        if merging:
            yield _pop_earliest(merging)


def _has_unset(part: Blocks) -> bool:
    return (part.end_ns or 0) > _UNSET_IF_LATER_NS


def _starts(parts: Sequence[Blocks]) -> Iterator[tuple[int, int, int, Block]]:
    """When each block begins, its part and offset.

    Of a block with unset log times that is when the block before it begins or, if none in it is set, ends.
    """
    for number, part in enumerate(parts):
        start_ns = end_ns = 0
        for block in part.blocks:
            if block.start_ns or not _has_unset(part):
                start_ns = block.start_ns
            elif block.end_ns == 0:
                start_ns = end_ns
            end_ns = max(end_ns, block.end_ns)
            yield start_ns, number, block.offset, block


def _timed(records: list[Record], start_ns: int, has_unset: bool) -> list[Timed]:
    """The records in the order of their times; an unset one has the time of the record before it, or else behind it."""
    times_ns = [record.log_time_ns for record in records]
    if has_unset and 0 in times_ns:
        latest_ns = next((time_ns for time_ns in times_ns if time_ns), start_ns)
        for at, time_ns in enumerate(times_ns):
            times_ns[at] = latest_ns = time_ns or latest_ns
    return sorted(zip(times_ns, records, strict=True), key=lambda timed: timed[0])


def _pop_earliest(merging: list[tuple[int, int, int, int, list[Timed]]]) -> Record:
    _, number, offset, index, records = merging[0]
    if index + 1 < len(records):
        heapq.heapreplace(merging, (records[index + 1][0], number, offset, index + 1, records))
    else:
        heapq.heappop(merging)
    return records[index][1]
