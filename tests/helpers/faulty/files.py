"""Recordings as other programs write them, and faults of files: topics by other names, other compression, damage."""

import random
from pathlib import Path

from drives import Simulated, write
from mcap.writer import CompressionType, Writer

from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter


def renamed(drive: Simulated, path: Path, topics: dict[str, list[str]]) -> Path:
    """The drive as a recording with each message on the topics that its own is called there."""
    whole = write(path.with_name("whole.mcap"), drive.arrivals)
    with McapWriter(path) as writer:
        for r in open_recording(whole):
            for topic in topics.get(r.topic, [r.topic]):
                writer.write(topic, r.type_name, r.encoding, r.log_time_ns, r.data)
    return path


def packed(drive: Simulated, path: Path, compression: CompressionType, chunk_bytes: int = 60_000) -> Path:
    """The drive as a recording in small chunks, compressed like this."""
    whole = write(path.with_name("whole.mcap"), drive.arrivals)
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk_bytes, compression=compression)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for r in open_recording(whole):
            if r.topic not in channels:
                schema = writer.register_schema(r.type_name, "ros2msg", b"")
                channels[r.topic] = writer.register_channel(r.topic, r.encoding, schema)
            writer.add_message(channels[r.topic], r.log_time_ns, r.data, r.log_time_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def spoil(path: Path, at: int, count: int = 64, seed: int = 0) -> Path:
    """Put other bytes in the place of `count`."""
    data = bytearray(path.read_bytes())
    data[at : at + count] = random.Random(seed).randbytes(count)
    path.write_bytes(data)
    return path
