"""Writing MCAP files: the same calls give the same bytes."""

from pathlib import Path

from mcap.writer import CompressionType, Writer

from wayfi.recordings.closing import Closing
from wayfi.recordings.mcap.blocks import RecordingError
from wayfi.recordings.ros.messages import schema_text
from wayfi.recordings.ros.topics import Encoding

CHUNK_BYTES = 1 << 20


class McapWriter(Closing):
    """Writes an MCAP file at `path` in ZSTD chunks of 1 MiB; a context manager.

    When the process is killed, the messages since the last complete chunk or `flush` are lost. Raises RecordingError if
    the file cannot be opened; the methods raise OSError.
    """

    def __init__(self, path: Path, profile: str = "ros2") -> None:
        try:
            self._file = path.open("wb")
        except OSError as error:
            raise RecordingError(f"cannot write {path}: {error.strerror or error}") from error
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile=profile, library="wayfi")
        self._schemas: dict[tuple[str, str], int] = {}
        self._channels: dict[tuple[str, str, str], int] = {}
        self._sequences: dict[int, int] = {}

    @property
    def size_bytes(self) -> int:
        """The size of the file in bytes so far, without the open chunk."""
        return self._file.tell()

    def write(self, topic: str, type_name: str, encoding: str, log_time_ns: int, data: bytes) -> None:
        """Add a message. The first message of a topic also writes its schema and channel."""
        channel = self._channel(topic, type_name, encoding)
        sequence = self._sequences.get(channel, 0)
        self._sequences[channel] = sequence + 1
        self._writer.add_message(channel, log_time_ns, data, publish_time=log_time_ns, sequence=sequence)

    def attach(self, name: str, data: bytes, media_type: str) -> None:
        """Add an attachment without a date."""
        self._writer.add_attachment(0, 0, name, media_type, data)

    def flush(self) -> None:
        """End the open chunk and pass all data to the operating system; a kill of the process no longer loses it."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """Write the index and close the file. A second call does nothing."""
        if not self._file.closed:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.close()

    def _channel(self, topic: str, type_name: str, encoding: str) -> int:
        key = (topic, type_name, encoding)
        if key not in self._channels:
            self._channels[key] = self._writer.register_channel(topic, encoding, self._schema(type_name, encoding))
        return self._channels[key]

    def _schema(self, type_name: str, encoding: str) -> int:
        """The id of the schema of `type_name`: a ros2msg definition for known types in CDR, else only the name."""
        if not type_name:
            return 0
        text = schema_text(type_name) if encoding == Encoding.CDR else None
        form = "" if text is None else "ros2msg"
        if (type_name, form) not in self._schemas:
            self._schemas[type_name, form] = self._writer.register_schema(type_name, form, (text or "").encode())
        return self._schemas[type_name, form]
