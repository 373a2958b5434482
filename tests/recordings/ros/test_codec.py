"""The message codec: round trips, agreement with rosbags, and nothing but CodecError on malformed bytes."""

import json
import math
import random
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Pose2, wrap
from wayfi.frontends.measurements import (
    LaserScan,
    Measurement,
    Odometry,
    PointCloud,
    Sensor,
    StaticTransform,
    StaticTransforms,
    WifiScan,
)
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR, TYPESTORE, schema_text, sensor_of_type
from wayfi.recordings.ros.ros_messages import new_message
from wayfi.recordings.ros.topics import Encoding

RELAXED = settings(deadline=None, max_examples=60)

STAMPS = st.integers(0, (2**31 - 1) * 10**9 + 999_999_999)
NAMES = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
FLOATS = st.floats(-1e6, 1e6)
FLOAT32S = st.floats(-1e6, 1e6, width=32)
RETURNS = st.one_of(st.floats(0, 100, width=32), st.sampled_from([math.nan, math.inf]))
BSSIDS = st.lists(st.integers(0, 255), min_size=6, max_size=6).map(lambda b: ":".join(f"{x:02x}" for x in b))


def float32s(values: list[float]) -> np.ndarray[Any, np.dtype[np.float32]]:
    return np.array(values, dtype=np.float32)


@st.composite
def odometries(draw: st.DrawFn) -> Odometry:
    pose = Pose2(draw(FLOATS), draw(FLOATS), wrap(draw(st.floats(-math.pi, math.pi))))
    root = np.array(draw(st.one_of(st.none(), st.lists(st.floats(0.1, 10.0), min_size=9, max_size=9))), dtype=object)
    covariance = None if root.shape == () else root.astype(float).reshape(3, 3) @ root.astype(float).reshape(3, 3).T
    return Odometry(draw(STAMPS), pose, covariance, draw(NAMES), draw(NAMES))


@st.composite
def laser_scans(draw: st.DrawFn) -> LaserScan:
    ranges = float32s(draw(st.lists(RETURNS, max_size=40)))
    numbers = [draw(FLOAT32S) for _ in range(5)]
    return LaserScan(draw(STAMPS), draw(NAMES), ranges, *numbers)


@st.composite
def point_clouds(draw: st.DrawFn) -> PointCloud:
    points = draw(st.lists(st.tuples(RETURNS, FLOAT32S, FLOAT32S), max_size=20))
    return PointCloud(draw(STAMPS), draw(NAMES), np.array(points, dtype=np.float32).reshape(-1, 3))


@st.composite
def wifi_scans(draw: st.DrawFn) -> WifiScan:
    reading = st.tuples(BSSIDS, NAMES, st.floats(-120, 0, width=32), st.integers(0, 2**32 - 1), FLOAT32S)
    columns = list(zip(*draw(st.lists(reading, max_size=8)), strict=True)) or [()] * 5
    bssids, ssids, rssi, frequency, age = columns
    return WifiScan(draw(STAMPS), draw(NAMES), bssids, float32s(list(rssi)), float32s(list(age)), ssids, frequency)


@st.composite
def static_transforms(draw: st.DrawFn) -> StaticTransforms:
    transform = st.builds(
        StaticTransform, NAMES, NAMES, st.tuples(FLOATS, FLOATS, FLOATS), st.tuples(FLOATS, FLOATS, FLOATS, FLOATS)
    )
    transforms = tuple(draw(st.lists(transform, min_size=1, max_size=4)))
    return StaticTransforms(draw(STAMPS), transforms)


MEASUREMENTS = st.one_of(odometries(), laser_scans(), point_clouds(), wifi_scans(), static_transforms())
SENSOR_OF_CLASS: dict[type, Sensor] = {
    Odometry: Sensor.ODOM,
    LaserScan: Sensor.SCAN,
    PointCloud: Sensor.POINTS,
    WifiScan: Sensor.WIFI,
    StaticTransforms: Sensor.TF_STATIC,
}
EXAMPLES: list[Measurement] = [
    Odometry(1_500_000_000_123_456_789, Pose2(1.0, -2.0, 3.0), np.diag([0.1, 0.2, 0.3])),
    LaserScan(1_500_000_000_123_456_789, "laser", float32s([1.0, math.inf, math.nan, 2]), -1.5, 0.25, 0.5, 30.0, 0.125),
    PointCloud(5, "velodyne", np.arange(12, dtype=np.float32).reshape(4, 3)),
    WifiScan(
        7, "wlan0", ("aa:bb:cc:dd:ee:ff", "00:11:22:33:44:55"), float32s([-40, -70]), float32s([0, 2]),
        ("home", "café"), (2412, 5180),
    ),
    StaticTransforms(9, (StaticTransform("base_link", "laser", (0.1, 0.2, 0.3), (0.0, 0.0, 0.6, 0.8)),)),
]  # fmt: skip


def sensor_of(measurement: Measurement) -> Sensor:
    return SENSOR_OF_CLASS[type(measurement)]


def ros_message(measurement: Measurement) -> Any:  # noqa: ANN401 - a class the typestore generates
    return TYPESTORE.deserialize_cdr(encode(measurement), TYPE_OF_SENSOR[sensor_of(measurement)])


def assert_same(a: object, b: object, *, infinity_is_nan: bool = False) -> None:
    assert type(a) is type(b)
    for name in a.__slots__:  # type: ignore[attr-defined]
        left, right = getattr(a, name), getattr(b, name)
        if isinstance(left, np.ndarray):
            expected = np.where(np.isfinite(left), left, np.nan) if infinity_is_nan else left
            assert right.dtype == left.dtype
            np.testing.assert_array_equal(right, expected)
        elif isinstance(left, Pose2):
            assert (right.x, right.y) == (left.x, left.y)
            assert abs(wrap(right.theta - left.theta)) < 1e-12
        else:
            assert left == right, name


@RELAXED
@given(MEASUREMENTS)
def test_cdr_round_trip(measurement: Measurement) -> None:
    assert_same(measurement, decode(encode(measurement), sensor_of(measurement), Encoding.CDR))


@RELAXED
@given(MEASUREMENTS)
def test_json_round_trip_with_every_non_finite_number_read_as_nan(measurement: Measurement) -> None:
    data = encode(measurement, Encoding.JSON)
    json.loads(data, parse_constant=pytest.fail)
    numbers_as_text = not isinstance(measurement, PointCloud)
    assert_same(measurement, decode(data, sensor_of(measurement), Encoding.JSON), infinity_is_nan=numbers_as_text)


@RELAXED
@given(MEASUREMENTS)
def test_cdr_of_either_byte_order_is_what_rosbags_reads_and_writes(measurement: Measurement) -> None:
    sensor, data = sensor_of(measurement), encode(measurement)
    message = TYPESTORE.deserialize_cdr(data, TYPE_OF_SENSOR[sensor])
    assert bytes(TYPESTORE.serialize_cdr(message, TYPE_OF_SENSOR[sensor])) == data
    big = bytes(TYPESTORE.serialize_cdr(message, TYPE_OF_SENSOR[sensor], little_endian=False))
    assert_same(measurement, decode(big, sensor, Encoding.CDR))


def test_fields_stand_where_ros_has_them() -> None:
    odometry, scan, _, wifi, _ = map(ros_message, EXAMPLES)
    assert (odometry.header.stamp.sec, odometry.header.stamp.nanosec) == (1_500_000_000, 123_456_789)
    assert odometry.pose.covariance[[0, 7, 35]].tolist() == [0.1, 0.2, 0.3]
    assert scan.angle_max == pytest.approx(-1.5 + 3 * 0.25)
    assert [reading.frequency for reading in wifi.readings] == [2412, 5180]


def test_arrays_are_owned_and_writable() -> None:
    for example in EXAMPLES:
        decoded = decode(encode(example), sensor_of(example), Encoding.CDR)
        for name in decoded.__slots__:
            value = getattr(decoded, name)
            assert not isinstance(value, np.ndarray) or value.flags.writeable


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda e: type(e).__name__)
@pytest.mark.parametrize("encoding", list(Encoding))
def test_every_truncation_is_a_codec_error(example: Measurement, encoding: Encoding) -> None:
    data = encode(example, encoding)
    for size in range(len(data)):
        with pytest.raises(CodecError):
            decode(data[:size], sensor_of(example), encoding)


def mutated(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        kind, at = rng.randrange(4), rng.randrange(len(changed))
        if kind == 0:
            changed[at] = rng.randrange(256)
        elif kind == 1:
            changed[at : at + 4] = rng.choice([b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x10", b"\0\0\0\0"])
        elif kind == 2:
            del changed[at : at + rng.randint(1, 8)]
        else:
            changed[at:at] = rng.randbytes(rng.randint(1, 8))
        changed = changed or bytearray(b"\0")
    return bytes(changed)


@pytest.mark.parametrize("encoding", list(Encoding))
def test_mutated_messages_raise_codec_error_or_decode(encoding: Encoding) -> None:
    rng = random.Random(11)
    originals = [(encode(example, encoding), sensor_of(example)) for example in EXAMPLES]
    refused = 0
    for _ in range(20_000):
        data, sensor = rng.choice(originals)
        try:
            measurement = decode(mutated(data, rng), sensor, encoding)
        except CodecError:
            refused += 1
            continue
        assert isinstance(measurement.stamp_ns, int)
        encode(measurement, Encoding.JSON)
    assert refused > 1_000


@pytest.mark.parametrize("sensor", list(Sensor))
@pytest.mark.parametrize(
    "data",
    [b"", b"null", b"[]", b"{}", b"1", b"\xff\xfe", b"[" * 100_000, b'{"header":{"stamp":{"sec":1e999}}}', b"9" * 5000],
    ids=range(9),
)
def test_other_json_is_a_codec_error(data: bytes, sensor: Sensor) -> None:
    with pytest.raises(CodecError):
        decode(data, sensor, Encoding.JSON)


WIFI_JSON: dict[str, Any] = {
    "header": {"stamp": {"sec": 12, "nanosec": 5}, "frame_id": "phone"},
    "readings": [{"bssid": "AA-BB-CC-DD-EE-FF", "rssi": -60}],
}


def test_json_of_a_phone_needs_only_what_matters() -> None:
    scan = decode(json.dumps(WIFI_JSON).encode(), Sensor.WIFI, Encoding.JSON)
    assert isinstance(scan, WifiScan)
    assert (scan.stamp_ns, scan.receiver, scan.bssids) == (12_000_000_005, "phone", ("aa:bb:cc:dd:ee:ff",))
    assert (scan.rssi.tolist(), scan.age_s.tolist(), scan.ssids, scan.frequency_mhz) == ([-60.0], [0.0], ("",), (0,))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (["header", "stamp", "sec"], 1.5),
        (["header", "stamp", "sec"], "1"),
        (["header", "stamp", "sec"], 2**31),
        (["header", "stamp", "sec"], -1),
        (["header", "stamp", "nanosec"], 10**9),
        (["header", "stamp"], None),
        (["header", "frame_id"], 3),
        (["readings"], {}),
        (["readings", 0], []),
        (["readings", 0, "bssid"], None),
        (["readings", 0, "rssi"], "-60"),
        (["readings", 0, "rssi"], True),
        (["readings", 0, "rssi"], 1e39),
        (["readings", 0, "rssi"], 10**400),
        (["readings", 0, "frequency"], -1),
        (["readings", 0, "frequency"], 2**32),
    ],
)
def test_wrong_json_values_are_codec_errors(path: list[Any], value: object) -> None:
    message = json.loads(json.dumps(WIFI_JSON))
    inner = message
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    with pytest.raises(CodecError):
        decode(json.dumps(message).encode(), Sensor.WIFI, Encoding.JSON)


@pytest.mark.parametrize("path", [["header"], ["readings"], ["readings", 0, "bssid"], ["readings", 0, "rssi"]])
def test_missing_required_json_fields_are_named(path: list[Any]) -> None:
    message = json.loads(json.dumps(WIFI_JSON))
    inner = message
    for key in path[:-1]:
        inner = inner[key]
    del inner[path[-1]]
    with pytest.raises(CodecError, match="is missing"):
        decode(json.dumps(message).encode(), Sensor.WIFI, Encoding.JSON)


def test_lone_surrogates_of_json_do_not_reach_the_measurement() -> None:
    data = b'{"header":{"stamp":{"sec":1},"frame_id":"\\ud800"},"readings":[]}'
    scan = decode(data, Sensor.WIFI, Encoding.JSON)
    assert isinstance(scan, WifiScan)
    scan.receiver.encode()


def test_an_ssid_that_is_not_utf8_does_not_cost_the_scan() -> None:
    data = encode(EXAMPLES[3]).replace("café".encode(), b"caf\xff\xfe")
    scan = decode(data, Sensor.WIFI, Encoding.CDR)
    assert isinstance(scan, WifiScan)
    assert scan.ssids[0] == "home"
    assert len(scan.bssids) == 2


def test_absurd_counts_are_refused_before_they_are_believed() -> None:
    beams = encode(LaserScan(0, "l", np.zeros(100_001, np.float32), 0.0, 0.1, 0.1, 30.0))
    with pytest.raises(CodecError, match="100001 beams"):
        decode(beams, Sensor.SCAN, Encoding.CDR)
    wifi = encode(WifiScan(0, "", (), float32s([]), float32s([])))
    with pytest.raises(CodecError, match="4294967295 readings"):
        decode(wifi[:-4] + b"\xff\xff\xff\xff", Sensor.WIFI, Encoding.CDR)


def odometry_message(quaternion_xyzw: tuple[float, ...], covariance: np.ndarray[Any, Any]) -> bytes:
    message = ros_message(EXAMPLES[0])
    message.pose.pose.orientation = new_message("geometry_msgs/msg/Quaternion", *quaternion_xyzw)
    message.pose.covariance = covariance
    return bytes(TYPESTORE.serialize_cdr(message, TYPE_OF_SENSOR[Sensor.ODOM]))


def odometry_of(quaternion_xyzw: tuple[float, ...], covariance: np.ndarray[Any, Any]) -> Odometry:
    decoded = decode(odometry_message(quaternion_xyzw, covariance), Sensor.ODOM, Encoding.CDR)
    assert isinstance(decoded, Odometry)
    return decoded


def test_covariance_takes_the_planar_rows_and_columns() -> None:
    full = np.arange(36.0)
    planar = odometry_of((0, 0, 0, 1), full).covariance
    assert planar is not None
    assert planar.tolist() == [[0, 1, 5], [6, 7, 11], [30, 31, 35]]
    assert odometry_of((0, 0, 0, 1), np.zeros(36)).covariance is None
    assert odometry_of((0, 0, 0, 1), np.full(36, np.nan)).covariance is None


def test_quaternions_need_not_be_of_unit_length_and_zeros_are_nan() -> None:
    assert odometry_of((0, 0, 3 * math.sin(0.5), 3 * math.cos(0.5)), np.zeros(36)).pose.theta == pytest.approx(1.0)
    assert math.isnan(odometry_of((0, 0, 0, 0), np.zeros(36)).pose.theta)
    assert not odometry_of((math.nan, 0, 0, 1), np.zeros(36)).pose.is_finite()
    assert -math.pi <= odometry_of((0, 0, 1, 0), np.zeros(36)).pose.theta < math.pi


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


@pytest.mark.parametrize(
    "measurement",
    [
        Odometry(-1, Pose2()),
        Odometry(2**80, Pose2()),
        LaserScan(0, "l", float32s([1.0]), 1e300, 0.1, 0.1, 30.0),
        WifiScan(0, "w", ("aa:bb:cc:dd:ee:ff",), float32s([]), float32s([])),
    ],
)
def test_what_does_not_fit_its_message_cannot_be_encoded(measurement: Measurement) -> None:
    with pytest.raises(CodecError):
        encode(measurement)


def test_types_are_known_by_every_name_they_go_by() -> None:
    for sensor, name in TYPE_OF_SENSOR.items():
        package, _, short = name.split("/")
        for form in (name, f"{package}/{short}", f"{package}::msg::dds_::{short}_"):
            assert sensor_of_type(form) is sensor
    assert sensor_of_type("std_msgs/msg/String") is None
    assert sensor_of_type("") is None


def test_schemas_hold_their_dependencies() -> None:
    text = schema_text(TYPE_OF_SENSOR[Sensor.WIFI])
    assert text is not None
    for name in ("std_msgs/Header", "builtin_interfaces/Time", "wifi_msgs/WifiReading"):
        assert f"{'=' * 80}\nMSG: {name}\n" in text
    assert schema_text("no_such/msg/Type") is None


def test_codec_error_is_a_wayfi_error() -> None:
    assert issubclass(CodecError, WayfiError)
