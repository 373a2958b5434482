"""Point clouds of any layout of fields, and sizes that do not fit the data."""

import struct
from typing import Any

import numpy as np
import pytest

from wayfi.frontends.measurements import (
    PointCloud,
    Sensor,
)
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR, TYPESTORE
from wayfi.recordings.ros.ros_messages import new_message
from wayfi.recordings.ros.topics import Encoding


def cloud_message(**changes: Any) -> bytes:  # noqa: ANN401
    """A 2 x 3 organised big-endian cloud: float64 y at 0, uint8 colour at 8, float32 x at 12, z at 16, rows padded."""
    fields = [("y", 0, 8), ("rgb", 8, 2), ("x", 12, 7), ("z", 16, 7)]
    data = bytearray()
    for row in range(2):
        for column in range(3):
            data += struct.pack(">dB3xff", 10 * row + column, 200, row, -column)
        data += b"\xee" * 4
    values: dict[str, Any] = {
        "header": new_message("std_msgs/msg/Header", new_message("builtin_interfaces/msg/Time", 1, 2), "lidar"),
        "height": 2,
        "width": 3,
        "fields": [new_message("sensor_msgs/msg/PointField", name, at, kind, 1) for name, at, kind in fields],
        "is_bigendian": True,
        "point_step": 20,
        "row_step": 64,
        "data": np.frombuffer(bytes(data), np.uint8),
        "is_dense": True,
    } | changes
    message = new_message(TYPE_OF_SENSOR[Sensor.POINTS], *values.values())
    return bytes(TYPESTORE.serialize_cdr(message, TYPE_OF_SENSOR[Sensor.POINTS]))


def test_points_are_read_by_their_fields() -> None:
    cloud = decode(cloud_message(), Sensor.POINTS, Encoding.CDR)
    assert isinstance(cloud, PointCloud)
    expected = [[row, 10 * row + column, -column] for row in range(2) for column in range(3)]
    assert cloud.points.tolist() == expected


def test_float64_points_beyond_float32_are_no_return() -> None:
    signalling_nan = bytes.fromhex("7ff4000000000000")
    data = np.frombuffer((struct.pack(">d", 1e300) + bytes(12) + signalling_nan + bytes(12)), np.uint8)
    cloud = decode(cloud_message(height=1, width=2, row_step=40, data=data), Sensor.POINTS, Encoding.CDR)
    assert isinstance(cloud, PointCloud)
    assert not np.isfinite(cloud.points[:, 1]).any()


@pytest.mark.parametrize(
    "changes",
    [
        {"height": 3},
        {"width": 4},
        {"height": 2**32 - 1, "row_step": 0, "point_step": 0},
        {"height": 2**32 - 1, "row_step": 1},
        {"height": 2**32 - 1, "width": 2**32 - 1, "point_step": 2**32 - 1},
        {"point_step": 19},
        {"row_step": 59},
        {"fields": []},
        {"data": np.zeros(0, np.uint8)},
    ],
)
def test_clouds_whose_sizes_do_not_fit_are_codec_errors(changes: dict[str, Any]) -> None:
    with pytest.raises(CodecError):
        decode(cloud_message(**changes), Sensor.POINTS, Encoding.CDR)


def test_an_empty_cloud_is_a_cloud() -> None:
    cloud = decode(cloud_message(height=0, data=np.zeros(0, np.uint8)), Sensor.POINTS, Encoding.CDR)
    assert isinstance(cloud, PointCloud)
    assert cloud.points.shape == (0, 3)
