"""Low-level reading of an MCAP file: its top-level records, and the blocks that hold its messages."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import breakup_chunk

from wayfi.backend.errors import WayfiError
from wayfi.recordings.ros.topics import Channel

READ_ERRORS = (McapError, ValueError, struct.error, zstandard.ZstdError, MemoryError, OverflowError, OSError)
MAGIC = b"\x89MCAP0\r\n"
RECORD_HEADER = struct.Struct("<BQ")
_LARGEST_CHUNK_BYTES = 1 << 30


class RecordingError(WayfiError):
    """A recording that cannot be opened, holds no message that can be read, or cannot be written."""


@dataclass(frozen=True, slots=True)
class Record:
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
    """`length` bytes at `offset` of the file that hold messages; `start_ns` is the earliest log time among them."""

    offset: int
    length: int
    start_ns: int
    is_chunk: bool


@dataclass(frozen=True, slots=True)
class RecordSpan:
    """Where the content of a top-level record is: `length` bytes at `offset`."""

    opcode: int
    offset: int
    length: int


def top_level_records(file: BinaryIO) -> Iterator[RecordSpan]:
    """The top-level records of `file`, up to the first incomplete one.

    When a span is yielded, the position of `file` is the start of its content.
    """
    end = file.seek(0, 2)
    offset = len(MAGIC)
    while offset + RECORD_HEADER.size <= end:
        file.seek(offset)
        opcode, length = RECORD_HEADER.unpack(file.read(RECORD_HEADER.size))
        offset += RECORD_HEADER.size
        if opcode == 0 or offset + length > end:
            return
        yield RecordSpan(opcode, offset, length)
        offset += length


def read_bytes(path: Path, offset: int, length: int) -> bytes:
    """`length` bytes at `offset` of the file at `path`. Raises one of READ_ERRORS if the file is too short."""
    with path.open("rb") as file:
        file.seek(offset)
        data = file.read(length)
    if len(data) < length:
        raise EndOfFile("the file has become shorter")
    return data


def read_block(path: Path, block: Block) -> list[McapRecord]:
    """The records in `block`. Raises one of READ_ERRORS for damage, a wrong checksum included."""
    data = read_bytes(path, block.offset, block.length)
    if not block.is_chunk:
        return list(breakup_chunk(Chunk("", data, 0, 0, 0, len(data))))
    chunk = Chunk.read(ReadDataStream(BytesIO(data)))
    if chunk.uncompressed_size > _LARGEST_CHUNK_BYTES:
        raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes")
    return list(breakup_chunk(chunk, validate_crc=True))
