"""Small MCAP files of odometry messages, for the tests of reading and writing them."""

from pathlib import Path

from mcap.reader import make_reader
from mcap.records import ChunkIndex

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import Odometry, Sensor
from wayfi.recordings.mcap.blocks import Record
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.messages import ODOMETRY
from wayfi.recordings.ros.topics import Encoding


def payload(number: int) -> bytes:
    return encode(Odometry(number, Pose2(number, 0.0, 0.0)))


def record(number: int, log_time_ns: int, topic: str = "/odom") -> Record:
    return Record(topic, ODOMETRY, "cdr", log_time_ns, payload(number))


def put(writer: McapWriter, records: list[Record]) -> None:
    for r in records:
        writer.write(r.topic, r.type_name, r.encoding, r.log_time_ns, r.data)


def write(path: Path, records: list[Record], profile: str = "ros2", flush_every: int = 10) -> Path:
    with McapWriter(path, profile) as writer:
        for at in range(0, len(records), flush_every):
            put(writer, records[at : at + flush_every])
            writer.flush()
    return path


def numbers(path: Path) -> list[int]:
    return [decode(r.data, Sensor.ODOM, Encoding.CDR).stamp_ns for r in open_recording(path)]


def chunk_indexes(path: Path) -> list[ChunkIndex]:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return summary.chunk_indexes
