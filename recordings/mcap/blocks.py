"""The blocks of an MCAP file that hold its messages: chunks, and runs of messages outside chunks."""

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from mcap.exceptions import EndOfFile, McapError
from mcap.records import ChunkIndex

from wayfi.backend.errors import WayfiError
from wayfi.recordings.mcap.chunks import Content, decompress
from wayfi.recordings.mcap.layout import CHUNK_HEADER, RECORD_HEADER, Bytes, RecordSpan
from wayfi.recordings.ros.topics import Channel

READ_ERRORS = (McapError, ValueError, struct.error, MemoryError, OverflowError, OSError)


class RecordingError(WayfiError):
    """A recording that cannot be opened, holds no message that can be read, or cannot be written."""


class Record(NamedTuple):
    """One message of a recording, logged at `log_time_ns`: `data` in `encoding` ('cdr', 'json' or another)."""

    topic: str
    type_name: str
    encoding: str
    log_time_ns: int
    data: bytes

    @property
    def channel(self) -> Channel:
        """The channel that it came on."""
        return Channel(self.topic, self.type_name, self.encoding)


@dataclass(frozen=True, slots=True)
class Block:
    """`length` bytes at `offset` of the file that hold messages, the earliest and latest of them at these log times.

    Those of a chunk are compressed from `size` bytes with this `checksum` (0: none); `compression` is None for a run of
    messages outside chunks. A block is `cut` if the file ends in it.
    """

    offset: int
    length: int
    start_ns: int
    end_ns: int
    compression: str | None = None
    size: int = 0
    checksum: int = 0
    cut: bool = False


def chunk_block(data: Bytes, chunk: RecordSpan) -> Block:
    """The block of the chunk that a scan has found."""
    start_ns, end_ns, size, checksum = CHUNK_HEADER.unpack_from(data, chunk.offset)
    at = chunk.offset + CHUNK_HEADER.size
    (letters,) = struct.unpack_from("<I", data, at)
    compression = data[at + 4 : at + 4 + letters].decode("utf-8", "replace")
    (length,) = struct.unpack_from("<Q", data, at + 4 + letters)
    offset = at + 4 + letters + 8
    there = min(length, chunk.end - offset)
    return Block(offset, there, start_ns, end_ns, compression, size, checksum, cut=there < length)


def indexed_block(data: Bytes, index: ChunkIndex) -> Block | None:
    """The block of a chunk whose own first fields may be damaged, None if it does not lie within the file."""
    end = index.chunk_start_offset + index.chunk_length
    if end > len(data) or index.compressed_size > index.chunk_length or index.chunk_length < CHUNK_HEADER.size + 9:
        return None
    *_, checksum = CHUNK_HEADER.unpack_from(data, index.chunk_start_offset + RECORD_HEADER.size)
    bounds = index.message_start_time, index.message_end_time
    packed = index.compressed_size
    return Block(end - packed, packed, *bounds, index.compression, index.uncompressed_size, checksum)


def read_block(path: Path, block: Block) -> Content:
    """The records in `block`, or those before its damage. Raises one of READ_ERRORS if the file has become shorter."""
    data = read_bytes(path, block.offset, block.length)
    if block.compression is None:
        return Content(data)
    return decompress(data, block.compression, block.size, block.checksum)


def read_bytes(path: Path, offset: int, length: int) -> bytes:
    """`length` bytes at `offset` of the file at `path`. Raises one of READ_ERRORS if the file is too short."""
    with path.open("rb") as file:
        file.seek(offset)
        data = file.read(length)
    if len(data) < length:
        raise EndOfFile("the file has become shorter")
    return data
