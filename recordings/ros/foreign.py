"""Messages of other kinds than ROS 2's own, converted: ROS 1, compressed one by one, and lasers with several echoes."""

import struct
from functools import lru_cache
from typing import Any

import lz4.frame
import numpy as np
import zstandard
from rosbags.serde import SerdeError

from wayfi.recordings.ros.messages import LASER_SCAN, TYPESTORE, canonical_type
from wayfi.recordings.ros.topics import Channel, Encoding

ROS1 = "ros1"
MULTI_ECHO_SCAN = "sensor_msgs/msg/MultiEchoLaserScan"
_RENAMED = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}
_DIFFERENT_IN_ROS1 = {
    *("sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/Range", "shape_msgs/msg/SolidPrimitive"),
    *("stereo_msgs/msg/DisparityImage", "visualization_msgs/msg/Marker", "visualization_msgs/msg/MarkerArray"),
}
_ZSTD_MAGIC, _LZ4_MAGIC = b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18"
_LARGEST_MESSAGE_BYTES = 1 << 28
_LARGEST_SCAN_BYTES = 1 << 22  # of small objects, whose decoding takes a second
_MALFORMED = (SerdeError, struct.error, ValueError, TypeError, IndexError, OverflowError, MemoryError, AssertionError)


def converted_channel(channel: Channel) -> Channel:
    """The channel as it is after `convert`: ROS 1 as ROS 2 where both have the type, several echoes as one."""
    type_name = _ros2_type(channel.type_name)
    if channel.encoding == ROS1 and _is_in_both(type_name):
        channel = Channel(channel.topic, type_name, Encoding.CDR)
    if channel.encoding == Encoding.CDR and type_name == MULTI_ECHO_SCAN:
        channel = Channel(channel.topic, LASER_SCAN, Encoding.CDR)
    return channel


def convert(data: bytes, channel: Channel) -> bytes:
    """A message of `channel` as one of its converted channel; empty, which no decoder takes, if it is malformed."""
    if data.startswith((_ZSTD_MAGIC, _LZ4_MAGIC)):  # no message in CDR or JSON begins like that
        data = _decompressed(data)
    type_name = _ros2_type(channel.type_name)
    try:
        if channel.encoding == ROS1 and _is_in_both(type_name):
            data = bytes(TYPESTORE.ros1_to_cdr(data, type_name))
        if type_name == MULTI_ECHO_SCAN and channel.encoding in (ROS1, Encoding.CDR):
            return _first_echoes(data)
    except _MALFORMED:
        return b""
    return data


@lru_cache(maxsize=256)
def _ros2_type(type_name: str) -> str:
    canonical = canonical_type(type_name)
    return _RENAMED.get(canonical, canonical)


def _is_in_both(type_name: str) -> bool:
    """Whether a type has the same fields in ROS 1 and ROS 2; the sequence number of headers is left out."""
    return type_name in TYPESTORE.fielddefs and type_name not in _DIFFERENT_IN_ROS1


def _first_echoes(data: bytes) -> bytes:
    """The LaserScan of the first echo of each beam, infinite where there is none."""
    if len(data) > _LARGEST_SCAN_BYTES:
        return b""
    message: Any = TYPESTORE.deserialize_cdr(data, MULTI_ECHO_SCAN)
    ranges = np.array([beam.echoes[0] if len(beam.echoes) else np.inf for beam in message.ranges], dtype=np.float32)
    angles = message.angle_min, message.angle_max, message.angle_increment, message.time_increment, message.scan_time
    limits = message.range_min, message.range_max
    scan = TYPESTORE.types[LASER_SCAN](message.header, *angles, *limits, ranges, np.zeros(0, np.float32))
    return bytes(TYPESTORE.serialize_cdr(scan, LASER_SCAN, little_endian=True))


def _decompressed(data: bytes) -> bytes:
    try:
        if data.startswith(_ZSTD_MAGIC):
            return zstandard.ZstdDecompressor().decompress(data, max_output_size=_LARGEST_MESSAGE_BYTES)
        return bytes(lz4.frame.decompress(data))
    except (zstandard.ZstdError, RuntimeError, MemoryError, OverflowError):
        return b""
