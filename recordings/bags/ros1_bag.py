"""A ROS 1 bag (version 2.0), whole, without its index, cut or damaged.

A bag is a sequence of records, each a header of named fields and data. Messages are in chunks, and so are the
connections that say what their topics are. Format: wiki.ros.org/Bags/Format/2.0.
"""

import bz2
import struct
from dataclasses import dataclass
from mmap import ACCESS_READ, mmap
from pathlib import Path

import lz4.frame

from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.bags.bag_part import BagPart
from wayfi.recordings.mcap.blocks import Block, Record, RecordingError, read_bytes
from wayfi.recordings.mcap.chunks import LARGEST_SALVAGED_BYTES
from wayfi.recordings.mcap.layout import Bytes
from wayfi.recordings.mcap.lz4_salvage import sound_beginning
from wayfi.recordings.ros.foreign import ROS1
from wayfi.recordings.ros.topics import Channel

MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _BAG_HEADER, _CHUNK, _CONNECTION = 2, 3, 5, 7
_LARGEST_HEADER_BYTES = 1 << 16
_FIELDS = {_MESSAGE: {b"conn", b"time"}, _CHUNK: {b"compression", b"size"}}
_BEFORE_OP_BYTES = 64
_FED_AT_ONCE_BYTES = 256


@dataclass(frozen=True, slots=True)
class BagRecord:
    """A record: its fields by name, and where its data is."""

    fields: dict[bytes, bytes]
    data_start: int
    end: int

    @property
    def opcode(self) -> int:
        """The kind of record; 0 without one."""
        op = self.fields.get(b"op", b"")
        return op[0] if len(op) == 1 else 0

    def number(self, name: bytes, size: int = 4) -> int:
        """The unsigned number in a field. Raises ValueError if there is no such field of this size."""
        value = self.fields.get(name, b"")
        if len(value) != size:
            raise ValueError(f"no field {name.decode()}")
        return int.from_bytes(value, "little")


def bag_record_at(data: Bytes, offset: int) -> BagRecord | None:
    """The record that begins at `offset`; None if none does, or not all of its header is there."""
    if offset + 4 > len(data):
        return None
    (length,) = struct.unpack_from("<I", data, offset)
    data_at = offset + 4 + length
    if length > _LARGEST_HEADER_BYTES or data_at + 4 > len(data):
        return None
    fields = fields_of(data[offset + 4 : data_at])
    if fields is None or b"op" not in fields:
        return None
    (size,) = struct.unpack_from("<I", data, data_at)
    return BagRecord(fields, data_at + 4, data_at + 4 + size)


def fields_of(header: bytes) -> dict[bytes, bytes] | None:
    """The named fields of a header, None if it does not consist of them."""
    fields = {}
    at = 0
    while at + 4 <= len(header):
        (length,) = struct.unpack_from("<I", header, at)
        name, equals, value = header[at + 4 : at + 4 + length].partition(b"=")
        if not equals or not name or at + 4 + length > len(header):
            return None
        fields[name] = value
        at += 4 + length
    return fields if at == len(header) else None


class Ros1Bag(BagPart):
    """The messages of the bag at `path`, in blocks that are its chunks. Every chunk is read once at the beginning.

    Raises RecordingError if the file cannot be read.
    """

    profile = ROS1

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._damage: dict[int, str] = {}
        self._cut = False
        self._connections: dict[int, Channel] = {}
        try:
            with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
                self._scan(data)
        except OSError as error:
            raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error
        self._read_once()

    @property
    def warning(self) -> str | None:
        """What was found so far to be missing or damaged, in one line."""
        if self._damage:
            at, what = next(iter(sorted(self._damage.items())))
            more = f" and in {len(self._damage) - 1} more places" if len(self._damage) > 1 else ""
            return f"{self.path.name} is damaged at byte {at} ({what}){more}; used what is sound"
        if self._cut:
            return f"{self.path.name} is cut off after {self.counts.total()} messages; used what is complete"
        return None

    def records(self, block: Block) -> list[Record]:
        """The messages of `block` in file order; of a damaged chunk those before the damage."""
        data = self._content(block)
        records: list[Record] = []
        offset = unread = 0
        while offset < len(data):
            found = bag_record_at(data, offset)
            if found is None or found.end > len(data):
                following = _next_record(data, offset + 1, _MESSAGE)
                unread += (following or block.size) - offset
                if following is None:
                    break
                records, offset = records[:-1], following  # the damage may have begun in the message before
                continue
            records += self._messages(found, data)
            offset = found.end
        unread += max(block.size - max(len(data), offset), 0)
        if unread and not block.cut:
            self._damage.setdefault(block.offset, f"{unread} bytes of a chunk cannot be read")
        return records

    def _scan(self, data: Bytes) -> None:
        offset = len(MAGIC)
        while offset < len(data):
            found = bag_record_at(data, offset)
            if found is None or (found.end > len(data) and found.opcode != _CHUNK):
                following = _next_record(data, offset + 1, _CHUNK)
                if following is None:
                    self._cut = True
                    return
                self._damage[offset] = f"{following - offset} bytes that are no record"
                offset = following
                continue
            self._add(found, data)
            offset = found.end

    def _add(self, found: BagRecord, data: Bytes) -> None:
        try:
            if found.opcode == _CHUNK:
                self._cut |= found.end > len(data)
                compression = found.fields.get(b"compression", b"").decode("ascii", "replace")
                length = min(found.end, len(data)) - found.data_start
                size, cut = found.number(b"size"), found.end > len(data)
                self.blocks.append(Block(found.data_start, length, 0, 0, compression, size, cut=cut))
            elif found.opcode == _BAG_HEADER:
                self._cut |= not 0 < found.number(b"index_pos", 8) <= len(data)
            elif found.opcode == _CONNECTION:
                self._connect(found, data[found.data_start : found.end])
        except ValueError as error:
            self._damage[found.data_start] = str(error)

    def _read_once(self) -> None:
        blocks = []
        for block in self.blocks:
            records = self.records(block)
            if not records:
                continue
            times_ns = [record.log_time_ns for record in records]
            self.counts.update(record.channel for record in records)
            compressed = block.compression, block.size
            blocks.append(Block(block.offset, block.length, min(times_ns), max(times_ns), *compressed, cut=block.cut))
        self.blocks = blocks

    def _messages(self, found: BagRecord, data: bytes) -> list[Record]:
        """The message of a record, if it is one of a known connection."""
        content = data[found.data_start : found.end]
        try:
            if found.opcode == _CONNECTION:
                self._connect(found, content)
            if found.opcode != _MESSAGE or found.number(b"conn") not in self._connections:
                return []
            seconds, nanoseconds = struct.unpack("<II", found.number(b"time", 8).to_bytes(8, "little"))
        except ValueError:
            return []
        return [Record(*self._connections[found.number(b"conn")], seconds * SECOND_NS + nanoseconds, content)]

    def _connect(self, found: BagRecord, content: bytes) -> None:
        fields = fields_of(content) or {}
        topic, type_name = found.fields.get(b"topic", b""), fields.get(b"type", b"")
        channel = Channel(topic.decode("utf-8", "replace"), type_name.decode("utf-8", "replace"), ROS1)
        self._connections[found.number(b"conn")] = channel

    def _content(self, block: Block) -> bytes:
        try:
            return decompress(read_bytes(self.path, block.offset, block.length), block.compression or "", block.size)
        except (OSError, EOFError, ValueError) as error:
            self._damage[block.offset] = str(error)
            return b""


def decompress(data: bytes, compression: str, size: int) -> bytes:
    """The content of a chunk, or what comes before its damage. Raises ValueError for an unknown compression."""
    limit = min(size, LARGEST_SALVAGED_BYTES)
    if compression == "none":
        return data
    if compression == "bz2":
        return _bz2_beginning(data, limit)
    if compression == "lz4":
        try:
            return bytes(lz4.frame.decompress(data))[:limit]
        except (RuntimeError, MemoryError, OverflowError, ValueError):
            return sound_beginning(data, limit)
    raise ValueError(f"unknown compression {compression!r}")


def _bz2_beginning(data: bytes, limit: int) -> bytes:
    decompressor = bz2.BZ2Decompressor()
    found = bytearray()
    try:
        for at in range(0, len(data), _FED_AT_ONCE_BYTES):
            found += decompressor.decompress(data[at : at + _FED_AT_ONCE_BYTES])
            if decompressor.eof or len(found) > limit:
                break
    except (OSError, EOFError, ValueError):
        pass
    return bytes(found[:limit])


def _next_record(data: Bytes, offset: int, opcode: int) -> int | None:
    """Where the next record of this kind begins: its header has the opcode in one of its first fields."""
    field = b"\x04\0\0\0op=" + bytes([opcode])
    while (at := data.find(field, offset)) >= 0:
        for start in range(max(offset, at - _BEFORE_OP_BYTES), at - 3):
            found = bag_record_at(data, start)
            if found is not None and found.opcode == opcode and found.fields.keys() >= _FIELDS[opcode]:
                return start
        offset = at + 1
    return None
