"""Point clouds of any layout of fields, as drivers send them too, and sizes that do not fit the data."""

import struct
from typing import Any

import numpy as np
import pytest

from wayfi.frontends.measurements import (
    PointCloud,
    Sensor,
)
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR, TYPESTORE
from wayfi.recordings.ros.ros_messages import new_message
from wayfi.recordings.ros.topics import Encoding

TYPE = TYPE_OF_SENSOR[Sensor.POINTS]
STAMP_S = 1_700_000_000
UINT8, UINT16, UINT32, FLOAT32, FLOAT64 = 2, 4, 6, 7, 8
FIELDS = {
    "velodyne": ("x 0 7, y 4 7, z 8 7, intensity 12 7, ring 16 4, time 18 7", "fff4xHf", 22),
    "ouster": ("x 0 7, y 4 7, z 8 7, intensity 16 7, t 20 6, ring 26 4", "fff8xI2xH4x", 32),
    "hesai": ("x 0 7, y 4 7, z 8 7, intensity 12 7, timestamp 16 8, ring 24 4", "fff4xdH", 26),
}
POINTS = np.array([[1.0, 2.0, 3.0], [np.nan, np.nan, np.nan], [-4.0, 5.0, -0.5], [7.0, -8.0, 0.25]], np.float32)
TIMES = {
    "velodyne": [0.0, 0.03, 0.06, 0.09],
    "ouster": [0, 30_000_000, 60_000_000, 90_000_000],
    "hesai": [STAMP_S + 0.0, STAMP_S + 0.03, STAMP_S + 0.06, STAMP_S + 0.09],
}
ROWS = 2


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
    message = new_message(TYPE, *values.values())
    return bytes(TYPESTORE.serialize_cdr(message, TYPE))


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


def driver_message(driver: str, order: str, row_padding: int) -> bytes:
    """A cloud of `driver` with two rows of two points."""
    names, form, step = FIELDS[driver]
    rows = []
    for point, time in zip(POINTS.tolist(), TIMES[driver], strict=True):
        values = {"velodyne": (*point, 3, time), "ouster": (*point, time, 3), "hesai": (*point, time, 3)}[driver]
        packed = struct.pack(order + form, *values)
        rows.append(packed.ljust(step, b"\xff"))
    width = len(rows) // ROWS
    data = b"".join(b"".join(rows[r * width : (r + 1) * width]) + b"\xee" * row_padding for r in range(ROWS))
    fields = [
        new_message("sensor_msgs/msg/PointField", name, int(offset), int(kind), 1)
        for name, offset, kind in (field.split() for field in names.split(", "))
    ]
    header = new_message("std_msgs/msg/Header", new_message("builtin_interfaces/msg/Time", STAMP_S, 0), "lidar")
    row_step = width * step + row_padding
    content: list[Any] = [header, ROWS, width, fields, order == ">", step, row_step, np.frombuffer(data, np.uint8)]
    return bytes(TYPESTORE.serialize_cdr(new_message(TYPE, *content, False), TYPE))


@pytest.mark.parametrize("driver", FIELDS)
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("row_padding", [0, 12])
def test_drivers_layouts_give_the_same_points_and_times(driver: str, order: str, row_padding: int) -> None:
    cloud = decode(driver_message(driver, order, row_padding), Sensor.POINTS, Encoding.CDR)
    assert isinstance(cloud, PointCloud)
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert cloud.time_s is not None
    np.testing.assert_allclose(cloud.time_s, [0.0, 0.03, 0.06, 0.09], atol=1e-6)


@pytest.mark.parametrize("encoding", [Encoding.CDR, Encoding.JSON])
def test_a_cloud_with_times_survives_encoding(encoding: Encoding) -> None:
    cloud = PointCloud(STAMP_S * 10**9, "lidar", POINTS, np.array([-0.05, 0.0, 0.01, 0.05], np.float32))
    again = decode(encode(cloud, encoding), Sensor.POINTS, encoding)
    assert isinstance(again, PointCloud)
    np.testing.assert_array_equal(again.points, cloud.points)
    assert again.time_s is not None
    np.testing.assert_allclose(again.time_s, [-0.05, 0.0, 0.01, 0.05], atol=1e-7)


def test_a_time_beyond_the_point_is_a_codec_error() -> None:
    driver = ("x 0 7, y 4 7, z 8 7, time 19 7", *FIELDS["velodyne"][1:])
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(FIELDS, "velodyne", driver)
        with pytest.raises(CodecError, match="point_step"):
            decode(driver_message("velodyne", "<", 0), Sensor.POINTS, Encoding.CDR)


def test_times_of_a_type_that_is_no_number_of_them_are_left_out() -> None:
    driver = ("x 0 7, y 4 7, z 8 7, time 16 4", *FIELDS["velodyne"][1:])
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(FIELDS, "velodyne", driver)
        cloud = decode(driver_message("velodyne", "<", 0), Sensor.POINTS, Encoding.CDR)
    assert isinstance(cloud, PointCloud)
    assert cloud.time_s is None
