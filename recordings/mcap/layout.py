"""Whether what stands at a place of an MCAP file is a whole record: its opcode is known, its fields fill its length.

The length of a record that was damaged hardly ever fits its fields, so that a scan notices damage before it leaps.
"""

import struct
from mmap import mmap
from typing import NamedTuple

from mcap.opcode import Opcode

Bytes = bytes | mmap
MAGIC = b"\x89MCAP0\r\n"
RECORD_HEADER = struct.Struct("<BQ")
MESSAGE_HEADER = struct.Struct("<HIQQ")
CHUNK_HEADER = struct.Struct("<QQQI")
"""The first fields of a chunk: message_start_time, message_end_time, uncompressed_size, uncompressed_crc."""
COMPRESSIONS = ("", "zstd", "lz4")

_TEXT, _DATA = "<I", "<Q"
_FIELDS: dict[int, tuple[int | str, ...]] = {
    Opcode.HEADER: (_TEXT, _TEXT),
    Opcode.FOOTER: (20,),
    Opcode.SCHEMA: (2, _TEXT, _TEXT, _TEXT),
    Opcode.CHANNEL: (4, _TEXT, _TEXT, _TEXT),
    Opcode.CHUNK: (CHUNK_HEADER.size, _TEXT, _DATA),
    Opcode.MESSAGE_INDEX: (2, _TEXT),
    Opcode.CHUNK_INDEX: (32, _TEXT, 8, _TEXT, 16),
    Opcode.ATTACHMENT: (16, _TEXT, _TEXT, _DATA, 4),
    Opcode.ATTACHMENT_INDEX: (40, _TEXT, _TEXT),
    Opcode.STATISTICS: (42, _TEXT),
    Opcode.METADATA: (_TEXT, _TEXT),
    Opcode.METADATA_INDEX: (16, _TEXT),
    Opcode.SUMMARY_OFFSET: (17,),
    Opcode.DATA_END: (4,),
}
"""The fields of each record but a message's: a number of bytes, or the format of the length before text or data."""


class RecordSpan(NamedTuple):
    """Where the content of a record is: `length` bytes at `offset`."""

    opcode: int
    offset: int
    length: int

    @property
    def start(self) -> int:
        """The offset of the record itself, which begins with opcode and length."""
        return self.offset - RECORD_HEADER.size

    @property
    def end(self) -> int:
        """The offset of what follows."""
        return self.offset + self.length


def header_at(data: Bytes, offset: int) -> RecordSpan | None:
    """The record that begins at `offset`, not checked; None if `data` ends within its opcode and length."""
    if offset + RECORD_HEADER.size > len(data):
        return None
    opcode, length = RECORD_HEADER.unpack_from(data, offset)
    return RecordSpan(opcode, offset + RECORD_HEADER.size, length)


def record_at(data: Bytes, offset: int) -> RecordSpan | None:
    """The record that begins at `offset` of `data`, None if no whole one does."""
    span = header_at(data, offset)
    return span if span is not None and span.end <= len(data) and is_whole(data, span) else None


def is_whole(data: Bytes, span: RecordSpan) -> bool:
    """Whether the fields of a record fill its length. Its end may lie beyond that of `data`."""
    if span.opcode == Opcode.MESSAGE:
        return span.length >= MESSAGE_HEADER.size
    if span.opcode not in _FIELDS:
        return False
    offset = span.offset
    for field in _FIELDS[span.opcode]:
        if isinstance(field, int):
            offset += field
            continue
        size = struct.calcsize(field)
        if offset + size > min(span.end, len(data)):
            return False
        (length,) = struct.unpack_from(field, data, offset)
        offset += size + length
    return offset == span.end and _is_sensible(data, span)


def _is_sensible(data: Bytes, span: RecordSpan) -> bool:
    if span.opcode == Opcode.CHUNK:
        start_ns, end_ns, _, _ = CHUNK_HEADER.unpack_from(data, span.offset)
        return bool(start_ns <= end_ns)
    return span.opcode != Opcode.MESSAGE_INDEX or (span.length - 6) % 16 == 0
