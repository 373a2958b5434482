"""The index of one MCAP file, which may be unfinished, cut or damaged, without its messages in memory.

The file is scanned record by record, reading little more than record headers; an incomplete record ends the scan.
Messages are in blocks: a chunk is a block, and so is a run of consecutive messages outside chunks. A block is read only
when its messages are needed; a block with a wrong checksum is skipped.
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
from mcap.records import Attachment, Header, McapRecord, Message, Schema, Statistics
from mcap.records import Channel as McapChannel

from wayfi.recordings.mcap.blocks import (
    MAGIC,
    READ_ERRORS,
    RECORD_HEADER,
    Block,
    Record,
    RecordingError,
    RecordSpan,
    read_block,
    read_bytes,
    top_level_records,
)
from wayfi.recordings.ros.topics import Channel

_CHUNK_HEADER = struct.Struct("<QQQ")
_MESSAGE_HEADER = struct.Struct("<HIQQ")
_MAX_RUN_BYTES = 1 << 20


class McapIndex:
    """The blocks, channels and attachments of the MCAP file at `path`.

    Raises RecordingError if the file is missing, unreadable, empty or not MCAP.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.profile = ""
        self.finished = False
        self.blocks: list[Block] = []
        self.counts: Counter[Channel] = Counter()
        self.start_ns: int | None = None
        self.end_ns: int | None = None
        self.warning: str | None = None
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, McapChannel] = {}
        self._attachments: list[RecordSpan] = []
        self._statistics: Statistics | None = None
        self._run: Block | None = None
        try:
            with path.open("rb") as file:
                self._scan(file)
        except OSError as error:
            raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error
        if self.finished and self._statistics is not None and self._channels:
            self._count_by_statistics(self._statistics)
        else:
            self._count_by_reading()

    def records(self, block: Block) -> list[Record]:
        """The messages of `block` in file order. A damaged block gives none, and sets `warning`."""
        try:
            contents = read_block(self.path, block)
        except READ_ERRORS as error:
            self._warn(f"{self.path.name} is damaged at byte {block.offset} ({error}); used what is complete")
            return []
        self._register(contents)
        messages = [record for record in contents if isinstance(record, Message)]
        known = [self._record(message) for message in messages if message.channel_id in self._channels]
        if len(known) < len(messages):
            self._warn(f"{self.path.name} has messages of channels it does not describe; left them out")
        return known

    def attachments(self) -> Iterator[Attachment]:
        """The attachments in file order. A damaged one is skipped, and sets `warning`."""
        for span in self._attachments:
            try:
                yield self._read_attachment(span)
            except READ_ERRORS as error:
                self._warn(f"{self.path.name} is damaged at byte {span.offset} ({error}); used what is complete")

    def _warn(self, text: str) -> None:
        self.warning = self.warning or text

    # Scanning the file

    def _scan(self, file: BinaryIO) -> None:
        magic = file.read(len(MAGIC))
        if not magic:
            raise RecordingError(f"{self.path} is empty")
        if magic != MAGIC:
            raise RecordingError(f"{self.path} is not an MCAP file")
        for span in top_level_records(file):
            try:
                self._add_record(file, span)
            except READ_ERRORS:
                break
            if self.finished:
                break
        self._end_run()

    def _add_record(self, file: BinaryIO, span: RecordSpan) -> None:
        if span.opcode == Opcode.MESSAGE:
            _, _, log_time_ns, _ = _MESSAGE_HEADER.unpack(file.read(_MESSAGE_HEADER.size))
            self._extend_run(span, log_time_ns)
            return
        self._end_run()
        if span.opcode == Opcode.CHUNK:
            start_ns, _, _ = _CHUNK_HEADER.unpack(file.read(_CHUNK_HEADER.size))
            self.blocks.append(Block(span.offset, span.length, start_ns, is_chunk=True))
        elif span.opcode == Opcode.ATTACHMENT:
            self._attachments.append(span)
        elif span.opcode == Opcode.FOOTER:
            self.finished = file.read(span.length + len(MAGIC))[span.length :] == MAGIC
        elif span.opcode in (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS):
            self._read_small_record(span.opcode, ReadDataStream(BytesIO(file.read(span.length))))

    def _read_small_record(self, opcode: int, stream: ReadDataStream) -> None:
        if opcode == Opcode.HEADER:
            self.profile = Header.read(stream).profile
        elif opcode == Opcode.STATISTICS:
            self._statistics = Statistics.read(stream)
        else:
            self._register([Schema.read(stream) if opcode == Opcode.SCHEMA else McapChannel.read(stream)])

    def _extend_run(self, span: RecordSpan, log_time_ns: int) -> None:
        start = span.offset - RECORD_HEADER.size
        if self._run is not None and span.offset + span.length - self._run.offset > _MAX_RUN_BYTES:
            self._end_run()
        if self._run is None:
            self._run = Block(start, 0, log_time_ns, is_chunk=False)
        length = span.offset + span.length - self._run.offset
        self._run = Block(self._run.offset, length, min(self._run.start_ns, log_time_ns), is_chunk=False)

    def _end_run(self) -> None:
        if self._run is not None:
            self.blocks.append(self._run)
            self._run = None

    # Reading blocks

    def _register(self, contents: list[McapRecord]) -> None:
        for record in contents:
            if isinstance(record, Schema):
                self._schemas[record.id] = record.name
            elif isinstance(record, McapChannel):
                self._channels[record.id] = record

    def _record(self, message: Message) -> Record:
        return Record(*self._channel(message.channel_id), message.log_time, message.data)

    def _channel(self, channel_id: int) -> Channel:
        channel = self._channels[channel_id]
        return Channel(channel.topic, self._schemas.get(channel.schema_id, ""), channel.message_encoding)

    def _read_attachment(self, span: RecordSpan) -> Attachment:
        data = read_bytes(self.path, span.offset, span.length)
        (checksum,) = struct.unpack("<I", data[-4:])
        if checksum not in (0, zlib.crc32(data[:-4])):
            raise ValueError("an attachment with a wrong checksum")
        attachment: Attachment = Attachment.read(ReadDataStream(BytesIO(data)))
        return attachment

    # Counting

    def _count_by_statistics(self, statistics: Statistics) -> None:
        for channel_id, count in statistics.channel_message_counts.items():
            if channel_id in self._channels:
                self.counts[self._channel(channel_id)] += count
        if statistics.message_count:
            self.start_ns, self.end_ns = statistics.message_start_time, statistics.message_end_time

    def _count_by_reading(self) -> None:
        """Read every block once, in file order, so that all channels are known before messages are read again."""
        readable = []
        for block in self.blocks:
            records = self.records(block)
            if not records:
                continue
            stamps_ns = [record.log_time_ns for record in records]
            self.counts.update(record.channel for record in records)
            self.start_ns = min(stamps_ns if self.start_ns is None else [self.start_ns, *stamps_ns])
            self.end_ns = max(stamps_ns if self.end_ns is None else [self.end_ns, *stamps_ns])
            readable.append(Block(block.offset, block.length, min(stamps_ns), block.is_chunk))
        self.blocks = readable
        if not self.finished:
            also = "; it is damaged before that, too" if self.warning else ""
            count = self.counts.total()
            self.warning = f"{self.path.name} is cut off after {count} messages; used what is complete{also}"
