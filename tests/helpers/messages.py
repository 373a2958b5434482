"""Measurements of every kind, drawn and by example, and their messages, for the tests of the codec."""

import math
from typing import Any

import numpy as np
from hypothesis import strategies as st

from wayfi.backend.pose2 import Pose2, wrap
from wayfi.frontends.measurements import (
    InitialPose,
    LaserScan,
    Measurement,
    MovingTransforms,
    Odometry,
    PointCloud,
    PoseFix,
    Sensor,
    StaticTransforms,
    Transform,
    WifiScan,
)
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR, TYPESTORE

STAMPS = st.integers(0, (2**31 - 1) * 10**9 + 999_999_999)
NAMES = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
FLOATS = st.floats(-1e6, 1e6)
FLOAT32S = st.floats(-1e6, 1e6, width=32)
RETURNS = st.one_of(st.floats(0, 100, width=32), st.sampled_from([math.nan, math.inf]))
BSSIDS = st.lists(st.integers(0, 255), min_size=6, max_size=6).map(lambda b: ":".join(f"{x:02x}" for x in b))


def float32s(values: list[float]) -> np.ndarray[Any, np.dtype[np.float32]]:
    return np.array(values, dtype=np.float32)


@st.composite
def poses(draw: st.DrawFn) -> tuple[Pose2, np.ndarray[Any, np.dtype[np.float64]] | None]:
    """A pose and its covariance."""
    pose = Pose2(draw(FLOATS), draw(FLOATS), wrap(draw(st.floats(-math.pi, math.pi))))
    root = np.array(draw(st.one_of(st.none(), st.lists(st.floats(0.1, 10.0), min_size=9, max_size=9))), dtype=object)
    covariance = None if root.shape == () else root.astype(float).reshape(3, 3) @ root.astype(float).reshape(3, 3).T
    return pose, covariance


@st.composite
def odometries(draw: st.DrawFn) -> Odometry:
    twist = draw(st.tuples(FLOATS, FLOATS, FLOATS))
    return Odometry(draw(STAMPS), *draw(poses()), draw(NAMES), draw(NAMES), twist)


@st.composite
def outside_poses(draw: st.DrawFn) -> PoseFix | InitialPose:
    return draw(st.sampled_from([PoseFix, InitialPose]))(draw(STAMPS), *draw(poses()), draw(NAMES))


@st.composite
def laser_scans(draw: st.DrawFn) -> LaserScan:
    ranges = float32s(draw(st.lists(RETURNS, max_size=40)))
    numbers = [draw(FLOAT32S) for _ in range(7)]
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


TRANSFORMS = st.lists(
    st.builds(Transform, NAMES, NAMES, st.tuples(FLOATS, FLOATS, FLOATS), st.tuples(FLOATS, FLOATS, FLOATS, FLOATS)),
    min_size=1,
    max_size=4,
).map(tuple)


@st.composite
def static_transforms(draw: st.DrawFn) -> StaticTransforms:
    return StaticTransforms(draw(STAMPS), draw(TRANSFORMS))


@st.composite
def moving_transforms(draw: st.DrawFn) -> MovingTransforms:
    transforms = draw(TRANSFORMS)
    stamps_ns = tuple(draw(STAMPS) for _ in transforms)
    return MovingTransforms(stamps_ns[0], transforms, stamps_ns)


MEASUREMENTS = st.one_of(
    odometries(), laser_scans(), point_clouds(), wifi_scans(), static_transforms(), moving_transforms(), outside_poses()
)
SENSOR_OF_CLASS: dict[type, Sensor] = {
    Odometry: Sensor.ODOM,
    LaserScan: Sensor.SCAN,
    PointCloud: Sensor.POINTS,
    WifiScan: Sensor.WIFI,
    StaticTransforms: Sensor.TF_STATIC,
    MovingTransforms: Sensor.TF,
    PoseFix: Sensor.FIX,
    InitialPose: Sensor.INITIAL_POSE,
}


EXAMPLES: list[Measurement] = [
    Odometry(1_500_000_000_123_456_789, Pose2(1.0, -2.0, 3.0), np.diag([0.1, 0.2, 0.3])),
    LaserScan(
        1_500_000_000_123_456_789, "laser", float32s([1.0, math.inf, math.nan, 2]), -1.5, 0.25, 0.5, 30.0, 0.125, -0.75,
        0.5,
    ),
    PointCloud(5, "velodyne", np.arange(12, dtype=np.float32).reshape(4, 3)),
    WifiScan(
        7, "wlan0", ("aa:bb:cc:dd:ee:ff", "00:11:22:33:44:55"), float32s([-40, -70]), float32s([0, 2]),
        ("home", "café"), (2412, 5180),
    ),
    StaticTransforms(9, (Transform("base_link", "laser", (0.1, 0.2, 0.3), (0.0, 0.0, 0.6, 0.8)),)),
    MovingTransforms(9, (Transform("odom", "base_link", (0.1, 0.2, 0.3), (0.0, 0.0, 0.6, 0.8)),), (9,)),
    PoseFix(11, Pose2(1.0, -2.0, 3.0), np.diag([0.1, 0.2, 0.3])),
    InitialPose(13, Pose2(1.0, -2.0, 3.0)),
]  # fmt: skip


def sensor_of(measurement: Measurement) -> Sensor:
    return SENSOR_OF_CLASS[type(measurement)]


def ros_message(measurement: Measurement) -> Any:  # noqa: ANN401 - a class the typestore generates
    return TYPESTORE.deserialize_cdr(encode(measurement), TYPE_OF_SENSOR[sensor_of(measurement)])


def assert_same(a: object, b: object, *, nan_is_infinity: bool = False) -> None:
    assert type(a) is type(b)
    for name in a.__slots__:  # type: ignore[attr-defined]
        left, right = getattr(a, name), getattr(b, name)
        if isinstance(left, np.ndarray):
            expected = np.where(np.isfinite(left), left, np.inf) if nan_is_infinity else left
            assert right.dtype == left.dtype
            np.testing.assert_array_equal(right, expected)
        elif isinstance(left, Pose2):
            assert (right.x, right.y) == (left.x, left.y)
            assert abs(wrap(right.theta - left.theta)) < 1e-12
        else:
            assert left == right, name
