"""A scan of an MCAP file's top-level records, which goes on behind what is damaged."""

import re
import struct
from collections.abc import Iterator

import numpy as np
from mcap.opcode import Opcode

from wayfi.recordings.mcap.layout import (
    CHUNK_HEADER,
    COMPRESSIONS,
    MAGIC,
    RECORD_HEADER,
    Bytes,
    RecordSpan,
    header_at,
    is_whole,
    record_at,
)

DAMAGE = 0
"""The opcode of a span that is no record but damaged; MCAP has none of 0."""
_FIRST_PRIVATE = 0x80
_MAYBE_RECORD = re.compile(rb"[\x01-\x0f][\s\S]{4}\0{4}")  # a known opcode, and a length below 4 GiB


def scan(data: Bytes) -> Iterator[RecordSpan]:
    """The records of a file and, with the opcode `DAMAGE`, the stretches between them that are none.

    A chunk in which the file ends is given as far as it goes; anything else that is incomplete ends the scan.
    """
    offset = len(MAGIC)
    chunk: RecordSpan | None = None
    while offset + RECORD_HEADER.size <= len(data):
        span = _record(data, offset, chunk)
        if span is None:
            if cut := _cut_chunk(data, offset):
                yield cut
                return
            following = _next_record(data, offset + 1)
            if following is None:
                return
            span = RecordSpan(DAMAGE, offset, following - offset)
        yield span
        chunk = span if span.opcode == Opcode.CHUNK else chunk
        if span.opcode == Opcode.FOOTER:
            return
        offset = span.end


def _record(data: Bytes, offset: int, chunk: RecordSpan | None) -> RecordSpan | None:
    span = header_at(data, offset)
    if span is None or span.end > len(data):
        return None
    if span.opcode >= _FIRST_PRIVATE:  # of an application, with any content
        return span if record_at(data, span.end) else None
    if not is_whole(data, span):
        return None
    if span.opcode == Opcode.MESSAGE_INDEX and chunk is not None and not _is_index_of(data, span, chunk):
        return None
    return span


def _is_index_of(data: Bytes, index: RecordSpan, chunk: RecordSpan) -> bool:
    """Whether the log times in a message index are those of its chunk; if not, something of it is damaged."""
    start_ns, end_ns, size, _ = CHUNK_HEADER.unpack_from(data, chunk.offset)
    log_times_ns, offsets = np.frombuffer(data[index.offset + 6 : index.end], "<u8").reshape(-1, 2).T
    return bool(((start_ns <= log_times_ns) & (log_times_ns <= end_ns) & (offsets < size)).all())


def _cut_chunk(data: Bytes, offset: int) -> RecordSpan | None:
    """The beginning of the chunk at `offset`, if only the end of the file is missing in it."""
    span = header_at(data, offset)
    if span is None or span.opcode != Opcode.CHUNK or span.end <= len(data) or not is_whole(data, span):
        return None
    return RecordSpan(span.opcode, span.offset, len(data) - span.offset)


def _next_record(data: Bytes, offset: int) -> int | None:
    """Where the next record begins behind damage: one that is followed by another, or by the end."""
    while maybe := _MAYBE_RECORD.search(data, offset):
        span = record_at(data, maybe.start())
        if span is not None and _is_followed(data, span):
            return maybe.start()
        offset = maybe.start() + 1
    return None


def _is_followed(data: Bytes, span: RecordSpan) -> bool:
    if span.opcode == Opcode.CHUNK and not _is_known_compression(data, span):
        return False
    if span.opcode == Opcode.FOOTER:
        return data[span.end :] == MAGIC
    return span.end == len(data) or record_at(data, span.end) is not None or _cut_chunk(data, span.end) is not None


def _is_known_compression(data: Bytes, chunk: RecordSpan) -> bool:
    at = chunk.offset + CHUNK_HEADER.size
    (length,) = struct.unpack_from("<I", data, at)
    return data[at + 4 : at + 4 + length] in [name.encode() for name in COMPRESSIONS]
