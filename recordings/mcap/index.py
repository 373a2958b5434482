"""The index of one MCAP file, which may be unfinished, cut or damaged, without its messages in memory.

The file is scanned record by record, reading little more than record headers. Messages are in blocks: a chunk is a
block, and so is a run of consecutive messages outside chunks. A block is read only when its messages are needed.

Damage costs what is damaged. Where a scan meets it, the chunks behind are found by the index at the end of the file or,
without one, by what looks like a record. Of a chunk that cannot be decompressed, or whose checksum is wrong, the
plausible messages are kept (salvage.py).
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from mmap import ACCESS_READ, mmap
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, ChunkIndex, Header, Schema, Statistics
from mcap.records import Channel as McapChannel

from wayfi.recordings.mcap.blocks import (
    READ_ERRORS,
    Block,
    Record,
    RecordingError,
    chunk_block,
    indexed_block,
    read_block,
    read_bytes,
)
from wayfi.recordings.mcap.layout import MAGIC, MESSAGE_HEADER, Bytes, RecordSpan
from wayfi.recordings.mcap.salvage import plausible_records_in, records_in
from wayfi.recordings.mcap.scan import DAMAGE, scan
from wayfi.recordings.ros.topics import Channel

_MAX_RUN_BYTES = 1 << 20
_FOOTER = struct.Struct("<QQI")  # summary_start, summary_offset_start, summary_crc
_SMALL = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX)


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
        self._damage: dict[int, str] = {}
        self._gaps: list[RecordSpan] = []
        self._unknown_channels = False
        self._second_at: int | None = None
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, McapChannel] = {}
        self._attachments: list[RecordSpan] = []
        self._chunk_indexes: list[ChunkIndex] = []
        self._statistics: Statistics | None = None
        self._run: Block | None = None
        self._scan()
        if self.finished and self._statistics is not None and self._channels and not self._damage:
            self._count_by_statistics(self._statistics)
        else:
            self._count_by_reading()

    @property
    def warning(self) -> str | None:
        """What was found so far to be missing or damaged, in one line."""
        damaged = self._damage_text()
        if not self.finished:
            also = f"; it is damaged before that, too: {damaged}" if damaged else ""
            return f"{self.path.name} is cut off after {self.counts.total()} messages; used what is complete{also}"
        if damaged:
            return f"{self.path.name} is damaged {damaged}; used what is sound"
        if self._second_at is not None:
            second = f"tail -c +{self._second_at + 1} {self.path.name} > second.mcap"
            return f"{self.path.name} has another recording appended, which is not read: `{second}` takes it out"
        if self._unknown_channels:
            return f"{self.path.name} has messages of channels it does not describe; left them out"
        return None

    def records(self, block: Block) -> list[Record]:
        """The messages of `block` in file order; of a damaged block those that may be kept."""
        try:
            content = read_block(self.path, block)
        except READ_ERRORS as error:
            self._damage[block.offset] = str(error)
            return []
        if content.damage and not block.cut:
            self._damage[block.offset] = content.damage
        if not content.damage:
            try:
                return self._messages(content.data, list(records_in(content.data)))
            except READ_ERRORS as error:
                self._damage[block.offset] = str(error)
        return self._salvaged(content.data, block)

    def attachments(self) -> Iterator[Attachment]:
        """The attachments in file order. A damaged one is skipped, and told in `warning`."""
        for span in self._attachments:
            try:
                yield self._read_attachment(span)
            except READ_ERRORS as error:
                self._damage[span.start] = str(error)

    def _damage_text(self) -> str:
        if not self._damage:
            return ""
        first = min(self._damage)
        others = len(self._damage) - 1
        return f"at byte {first} ({self._damage[first]})" + (f" and in {others} more places" if others else "")

    # Scanning the file

    def _scan(self) -> None:
        try:
            with self.path.open("rb") as file:
                magic = file.read(len(MAGIC))
                if not magic:
                    raise RecordingError(f"{self.path} is empty")
                with mmap(file.fileno(), 0, access=ACCESS_READ) as data:
                    if MAGIC not in (magic, data[-len(MAGIC) :]):
                        raise RecordingError(f"{self.path} is not an MCAP file")
                    if magic != MAGIC:
                        self._damage[0] = "it does not begin as MCAP does"
                    self._add_records(data)
        except OSError as error:
            raise RecordingError(f"cannot read {self.path}: {error.strerror or error}") from error

    def _add_records(self, data: mmap) -> None:
        for span in scan(data):
            if span.opcode == Opcode.MESSAGE:
                _, _, log_time_ns, _ = MESSAGE_HEADER.unpack_from(data, span.offset)
                self._extend_run(span, log_time_ns)
                continue
            self._end_run()
            try:
                self._add_record(data, span)
            except READ_ERRORS as error:
                self._damage[span.start] = str(error)
        self._end_run()
        if self._gaps:
            self._add_indexed_blocks(data)

    def _add_record(self, data: Bytes, span: RecordSpan) -> None:
        if span.opcode == DAMAGE:
            self._gaps.append(span)
            self._damage[span.offset] = f"{span.length} bytes that are no record"
        elif span.opcode == Opcode.CHUNK:
            self.blocks.append(chunk_block(data, span))
        elif span.opcode == Opcode.ATTACHMENT:
            self._attachments.append(span)
        elif span.opcode == Opcode.FOOTER:
            end = span.end + len(MAGIC)
            self.finished = data[span.end : end] == MAGIC
            self._second_at = end if data[end : end + len(MAGIC)] == MAGIC else None
            self._check_summary(data, span)
        elif span.opcode in _SMALL:
            self._add_small_record(span.opcode, ReadDataStream(BytesIO(data[span.offset : span.end])))

    def _check_summary(self, data: Bytes, footer: RecordSpan) -> None:
        """Note damage of the index and the statistics, which may leave them records as before."""
        start, _, checksum = _FOOTER.unpack_from(data, footer.offset)
        if checksum and start and zlib.crc32(data[start : footer.end - 4]) != checksum:
            self._damage.setdefault(min(start, footer.start), "a wrong checksum of its index")

    def _add_small_record(self, opcode: int, stream: ReadDataStream) -> None:
        if opcode == Opcode.HEADER:
            self.profile = Header.read(stream).profile
        elif opcode == Opcode.STATISTICS:
            self._statistics = Statistics.read(stream)
        elif opcode == Opcode.CHUNK_INDEX:
            self._chunk_indexes.append(ChunkIndex.read(stream))
        else:
            self._register(opcode, stream)

    def _register(self, opcode: int, stream: ReadDataStream) -> None:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas[schema.id] = schema.name
        else:
            channel = McapChannel.read(stream)
            self._channels[channel.id] = channel

    def _extend_run(self, span: RecordSpan, log_time_ns: int) -> None:
        run = self._run
        if run is not None and (span.end - run.offset > _MAX_RUN_BYTES or span.start != run.offset + run.length):
            self._end_run()
            run = None
        if run is None:
            run = Block(span.start, 0, log_time_ns, log_time_ns)
        bounds = min(run.start_ns, log_time_ns), max(run.end_ns, log_time_ns)
        self._run = Block(run.offset, span.end - run.offset, *bounds)

    def _end_run(self) -> None:
        if self._run is not None:
            self.blocks.append(self._run)
            self._run = None

    def _add_indexed_blocks(self, data: Bytes) -> None:
        """Add the chunks whose beginning is damaged, by their index at the end of the file.

        The messages that were found in a chunk, where it is not compressed, are then read as those of the chunk.
        """
        chunks = [block for block in self.blocks if block.compression is not None]
        added = []
        for index in self._chunk_indexes:
            block = indexed_block(data, index)
            if block is None or any(_overlap(block, chunk) for chunk in chunks):
                continue
            if any(gap.offset < block.offset and index.chunk_start_offset < gap.end for gap in self._gaps):
                added.append(block)
        runs = [b for b in self.blocks if b.compression is None and not any(_overlap(b, other) for other in added)]
        self.blocks = sorted([*chunks, *added, *runs], key=lambda block: block.offset)

    # Reading blocks

    def _messages(self, data: bytes, spans: list[RecordSpan]) -> list[Record]:
        for span in spans:
            if span.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._register(span.opcode, ReadDataStream(BytesIO(data[span.offset : span.end])))
        messages = [self._record(data, span) for span in spans if span.opcode == Opcode.MESSAGE]
        known = [message for message in messages if message is not None]
        self._unknown_channels |= len(known) < len(messages)
        return known

    def _salvaged(self, data: bytes, block: Block) -> list[Record]:
        def is_plausible(content: bytes, span: RecordSpan) -> bool:
            channel_id, _, log_time_ns, _ = MESSAGE_HEADER.unpack_from(content, span.offset)
            return channel_id in self._channels and block.start_ns <= log_time_ns <= block.end_ns

        records: list[Record] = []
        for span in plausible_records_in(data, is_plausible):
            try:
                records += self._messages(data, [span])
            except READ_ERRORS:  # a channel whose name is no text
                continue
        return records

    def _record(self, data: bytes, span: RecordSpan) -> Record | None:
        """The message at `span`, None if its channel is not described."""
        channel_id, _, log_time_ns, _ = MESSAGE_HEADER.unpack_from(data, span.offset)
        if channel_id not in self._channels:
            return None
        return Record(*self._channel(channel_id), log_time_ns, data[span.offset + MESSAGE_HEADER.size : span.end])

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
            readable.append(replace(block, start_ns=min(stamps_ns)))
        self.blocks = readable


def _overlap(one: Block, other: Block) -> bool:
    return one.offset < other.offset + other.length and other.offset < one.offset + one.length
