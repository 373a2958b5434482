"""What is in one MCAP file, finished or cut, whole or damaged, found without holding its messages.

A file is walked record by record, reading little more than their headers; a record that does not end in the file ends
the walk. Messages lie in blocks: a chunk is one, and so is a run of messages outside chunks. A block is read when its
time has come, and one that does not pass its checksum is left out.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema, Statistics

from wayfi.recordings.mcap.blocks import (
    DAMAGE,
    MAGIC,
    RECORD_HEAD,
    Block,
    Place,
    Record,
    RecordingError,
    places,
    read_block,
    read_bytes,
)

_CHUNK_HEAD = struct.Struct("<QQQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_RUN_BYTES = 1 << 20


class McapIndex:
    """The blocks, channels and extras of the MCAP file at `path`.

    Raises RecordingError where the file is missing, empty or no MCAP.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.profile = ""
        self.finished = False
        self.blocks: list[Block] = []
        self.counts: Counter[str] = Counter()
        self.start_ns: int | None = None
        self.end_ns: int | None = None
        self.warning: str | None = None
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, Channel] = {}
        self._extras: list[Place] = []
        self._statistics: Statistics | None = None
        self._run: Block | None = None
        try:
            with path.open("rb") as file:
                self._walk(file)
        except OSError as error:
            raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error
        if self.finished and self._statistics is not None and self._channels:
            self._count_by_statistics(self._statistics)
        else:
            self._count_by_reading()

    def records(self, block: Block) -> list[Record]:
        """The messages of `block` in file order; none, and a warning, where it is damaged."""
        try:
            contents = read_block(self.path, block)
        except DAMAGE as error:
            self._warn(f"{self.path.name} is damaged at byte {block.offset} ({error}); used what is complete")
            return []
        self._learn(contents)
        messages = [record for record in contents if isinstance(record, Message)]
        known = [self._record(message) for message in messages if message.channel_id in self._channels]
        if len(known) < len(messages):
            self._warn(f"{self.path.name} has messages of channels it does not describe; left them out")
        return known

    def metadata(self) -> Iterator[Metadata]:
        """The metadata records in file order."""
        yield from (extra for extra in self._read_extras(Opcode.METADATA) if isinstance(extra, Metadata))

    def attachments(self) -> Iterator[Attachment]:
        """The attachments in file order; one that does not pass its checksum is left out with a warning."""
        yield from (extra for extra in self._read_extras(Opcode.ATTACHMENT) if isinstance(extra, Attachment))

    def _warn(self, text: str) -> None:
        self.warning = self.warning or text

    # Walking

    def _walk(self, file: BinaryIO) -> None:
        magic = file.read(len(MAGIC))
        if not magic:
            raise RecordingError(f"{self.path} is empty")
        if magic != MAGIC:
            raise RecordingError(f"{self.path} is not an MCAP file")
        for place in places(file):
            try:
                self._take(file, place)
            except DAMAGE:
                break
            if self.finished:
                break
        self._end_run()

    def _take(self, file: BinaryIO, place: Place) -> None:
        if place.opcode == Opcode.MESSAGE:
            _, _, log_time_ns, _ = _MESSAGE_HEAD.unpack(file.read(_MESSAGE_HEAD.size))
            self._extend_run(place, log_time_ns)
            return
        self._end_run()
        if place.opcode == Opcode.CHUNK:
            start_ns, _, _ = _CHUNK_HEAD.unpack(file.read(_CHUNK_HEAD.size))
            self.blocks.append(Block(place.offset, place.length, start_ns, is_chunk=True))
        elif place.opcode in (Opcode.METADATA, Opcode.ATTACHMENT):
            self._extras.append(place)
        elif place.opcode == Opcode.FOOTER:
            self.finished = file.read(place.length + len(MAGIC))[place.length :] == MAGIC
        elif place.opcode in (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS):
            self._take_whole(place.opcode, ReadDataStream(BytesIO(file.read(place.length))))

    def _take_whole(self, opcode: int, stream: ReadDataStream) -> None:
        if opcode == Opcode.HEADER:
            self.profile = Header.read(stream).profile
        elif opcode == Opcode.STATISTICS:
            self._statistics = Statistics.read(stream)
        else:
            self._learn([Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream)])

    def _extend_run(self, place: Place, log_time_ns: int) -> None:
        start = place.offset - RECORD_HEAD.size
        if self._run is not None and place.offset + place.length - self._run.offset > _RUN_BYTES:
            self._end_run()
        if self._run is None:
            self._run = Block(start, 0, log_time_ns, is_chunk=False)
        length = place.offset + place.length - self._run.offset
        self._run = Block(self._run.offset, length, min(self._run.start_ns, log_time_ns), is_chunk=False)

    def _end_run(self) -> None:
        if self._run is not None:
            self.blocks.append(self._run)
            self._run = None

    # Reading

    def _learn(self, contents: list[McapRecord]) -> None:
        for record in contents:
            if isinstance(record, Schema):
                self._schemas[record.id] = record.name
            elif isinstance(record, Channel):
                self._channels[record.id] = record

    def _record(self, message: Message) -> Record:
        channel = self._channels[message.channel_id]
        type_name = self._schemas.get(channel.schema_id, "")
        return Record(channel.topic, type_name, channel.message_encoding, message.log_time, message.data)

    def _read_extras(self, opcode: Opcode) -> Iterator[McapRecord]:
        for place in self._extras:
            if place.opcode != opcode:
                continue
            try:
                yield self._read_extra(place)
            except DAMAGE as error:
                self._warn(f"{self.path.name} is damaged at byte {place.offset} ({error}); used what is complete")

    def _read_extra(self, place: Place) -> McapRecord:
        data = read_bytes(self.path, place.offset, place.length)
        stream = ReadDataStream(BytesIO(data))
        if place.opcode == Opcode.METADATA:
            metadata: Metadata = Metadata.read(stream)
            return metadata
        (checksum,) = struct.unpack("<I", data[-4:])
        if checksum not in (0, zlib.crc32(data[:-4])):
            raise ValueError("an attachment with a wrong checksum")
        attachment: Attachment = Attachment.read(stream)
        return attachment

    # Counting

    def _count_by_statistics(self, statistics: Statistics) -> None:
        for channel_id, count in statistics.channel_message_counts.items():
            if channel_id in self._channels:
                self.counts[self._channels[channel_id].topic] += count
        if statistics.message_count:
            self.start_ns, self.end_ns = statistics.message_start_time, statistics.message_end_time

    def _count_by_reading(self) -> None:
        """Reads every block once, in file order: channels are known before any message is asked for."""
        readable = []
        for block in self.blocks:
            records = self.records(block)
            if not records:
                continue
            stamps_ns = [record.log_time_ns for record in records]
            self.counts.update(record.topic for record in records)
            self.start_ns = min(stamps_ns if self.start_ns is None else [self.start_ns, *stamps_ns])
            self.end_ns = max(stamps_ns if self.end_ns is None else [self.end_ns, *stamps_ns])
            readable.append(Block(block.offset, block.length, min(stamps_ns), block.is_chunk))
        self.blocks = readable
        if not self.finished:
            also = "; it is damaged before that, too" if self.warning else ""
            count = self.counts.total()
            self.warning = f"{self.path.name} is cut off after {count} messages; used what is complete{also}"
