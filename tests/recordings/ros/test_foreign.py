"""Messages of ROS 1, compressed one by one, or with several echoes, come as those of ROS 2."""

from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap_files import payload, record

from wayfi.frontends.measurements import LaserScan, Sensor
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.foreign import MULTI_ECHO_SCAN, convert, converted_channel
from wayfi.recordings.ros.messages import LASER_SCAN, ODOMETRY, TF_MESSAGE, TYPESTORE
from wayfi.recordings.ros.ros_messages import header, new_message
from wayfi.recordings.ros.topics import Channel, Encoding

ROS1_ODOM = Channel("/odom", "nav_msgs/Odometry", "ros1")


def ros1(data: bytes, type_name: str) -> bytes:
    return bytes(TYPESTORE.cdr_to_ros1(data, type_name))


def multi_echo() -> bytes:
    echoes = [[1.0, 2.0], [], [3.0]]
    beams = [new_message("sensor_msgs/msg/LaserEcho", np.array(e, np.float32)) for e in echoes]
    scan = new_message(MULTI_ECHO_SCAN, header(7, "laser"), -1.0, 1.0, 1.0, 0.0, 0.1, 0.1, 30.0, beams, [])
    return bytes(TYPESTORE.serialize_cdr(scan, MULTI_ECHO_SCAN, little_endian=True))


def test_a_ros_1_recording_in_mcap_is_read_as_one_of_ros_2(tmp_path: Path) -> None:
    with McapWriter(tmp_path / "a.mcap", profile="ros1") as writer:
        for n in range(3):
            writer.write("/odom", "nav_msgs/Odometry", "ros1", n, ros1(payload(n), ODOMETRY))
        writer.write("/chatter", "my_msgs/Chatter", "ros1", 9, b"as it is")
    recording = open_recording(tmp_path / "a.mcap")
    assert recording.channels == (("/chatter", "my_msgs/Chatter", "ros1"), ("/odom", ODOMETRY, "cdr"))
    *odometry, chatter = recording
    assert odometry == [record(n, n) for n in range(3)]
    assert chatter.data == b"as it is"


def test_the_old_transforms_are_the_new_ones() -> None:
    assert converted_channel(Channel("/tf", "tf/tfMessage", "ros1")) == ("/tf", TF_MESSAGE, "cdr")


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_of_several_echoes_the_first_is_taken(encoding: str) -> None:
    data = multi_echo() if encoding == "cdr" else ros1(multi_echo(), MULTI_ECHO_SCAN)
    channel = Channel("/scan", "sensor_msgs/MultiEchoLaserScan", encoding)
    assert converted_channel(channel) == ("/scan", LASER_SCAN, "cdr")
    scan = decode(convert(data, channel), Sensor.SCAN, Encoding.CDR)
    assert isinstance(scan, LaserScan)
    assert scan.ranges.tolist() == [1.0, np.inf, 3.0]
    assert (scan.stamp_ns, scan.angle_min) == (7, -1.0)


def test_a_compressed_message_is_decompressed() -> None:
    channel = Channel("/odom", ODOMETRY, "cdr")
    assert convert(zstandard.compress(payload(5)), channel) == payload(5)
    assert convert(lz4.frame.compress(payload(5)), channel) == payload(5)


@pytest.mark.parametrize(
    "data", [b"", b"\0" * 30, b"\x28\xb5\x2f\xfd and so on", b"\x04\x22\x4d\x18 and so on", b"\xff" * 200]
)
def test_what_is_malformed_is_refused_by_the_decoder(data: bytes) -> None:
    for channel in (ROS1_ODOM, Channel("/scan", MULTI_ECHO_SCAN, "ros1"), Channel("/scan", MULTI_ECHO_SCAN, "cdr")):
        sensor = Sensor.ODOM if channel is ROS1_ODOM else Sensor.SCAN
        with pytest.raises(CodecError):
            decode(convert(data, channel), sensor, Encoding.CDR)
