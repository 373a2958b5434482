"""Converts ROS messages, which are objects of the typestore's classes, to measurements."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.frames.pose3 import heading, tilt
from wayfi.frontends.measurements import (
    SECOND_NS,
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
from wayfi.frontends.wifi.readings import bssid_of
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.messages import PLANAR_INDICES
from wayfi.recordings.ros.point_layout import points_of_cloud
from wayfi.recordings.ros.point_times import seconds_after_stamp

Message = Any
Float32s = NDArray[np.float32]

MAX_BEAMS = 50_000
MAX_READINGS = 2_000
MAX_TRANSFORMS = 300
MAX_FIELDS = 100  # of a point
MAX_NAME = 256  # letters of a frame or a receiver
MAX_TILT_RAD = 0.5  # of a base: steeper is the pose of something else, as of a camera whose z axis looks ahead


def to_measurement(message: Message, sensor: Sensor) -> Measurement:
    """The measurement in `message`, of the type of `sensor`. Raises CodecError for numbers out of range."""
    return _READERS[sensor](message)


def stamp_ns_of(sec: int, nanosec: int) -> int:
    """The nanoseconds of a ROS time. Raises CodecError for a negative time or nanosec >= 1e9."""
    if sec < 0 or nanosec >= SECOND_NS:
        raise CodecError(f"stamp of {sec} s and {nanosec} ns is out of range")
    return sec * SECOND_NS + nanosec


def wifi_scan(
    stamp_ns: int,
    receiver: str,
    bssids: Sequence[str],
    ssids: Sequence[str],
    rssi: Float32s,
    frequency_mhz: Sequence[int],
    age_s: Float32s,
) -> WifiScan:
    """The WiFi scan with these fields, BSSIDs converted to lower-case colon form."""
    return WifiScan(stamp_ns, receiver, tuple(map(bssid_of, bssids)), rssi, age_s, tuple(ssids), tuple(frequency_mhz))


def check_count(what: str, count: int, limit: int) -> None:
    """Raise CodecError if `count` is over `limit`."""
    if count > limit:
        raise CodecError(f"{count} {what} in one message; the limit is {limit}")


def check_name(name: str) -> str:
    """Return `name`, of a frame or a receiver. Raises CodecError if it is longer than `MAX_NAME`."""
    if len(name) > MAX_NAME:
        raise CodecError(f"a name of {len(name)} letters; the limit is {MAX_NAME}")
    return name


def _header_stamp_ns(message: Message) -> int:
    stamp = message.header.stamp
    check_name(message.header.frame_id)
    return stamp_ns_of(stamp.sec, stamp.nanosec)


def _planar_covariance(covariance: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """(3, 3) in (x, y, theta) of the (36,) `covariance`; None if all zero or not finite."""
    planar = covariance[PLANAR_INDICES].reshape(3, 3)
    return planar if np.isfinite(planar).all() and planar.any() else None


def _read_odometry(message: Message) -> Odometry:
    pose, twist = message.pose.pose, message.twist.twist
    q = pose.orientation
    return Odometry(
        _header_stamp_ns(message),
        Pose2(pose.position.x, pose.position.y, heading((q.x, q.y, q.z, q.w))),
        _planar_covariance(message.pose.covariance),
        message.header.frame_id,
        check_name(message.child_frame_id),
        (twist.linear.x, twist.linear.y, twist.angular.z),
    )


def _read_laser_scan(message: Message) -> LaserScan:
    check_count("beams", len(message.ranges), MAX_BEAMS)
    return LaserScan(
        _header_stamp_ns(message),
        message.header.frame_id,
        np.array(message.ranges, dtype=np.float32),
        message.angle_min,
        message.angle_increment,
        message.range_min,
        message.range_max,
        message.time_increment,
        message.angle_max,
        message.scan_time,
    )


def _read_point_cloud(message: Message) -> PointCloud:
    stamp_ns = _header_stamp_ns(message)
    points, times = points_of_cloud(message)
    time_s = None if times is None else seconds_after_stamp(times, stamp_ns)
    return PointCloud(stamp_ns, message.header.frame_id, points, time_s)


def _read_wifi_scan(message: Message) -> WifiScan:
    readings = message.readings
    check_count("readings", len(readings), MAX_READINGS)
    return wifi_scan(
        _header_stamp_ns(message),
        message.header.frame_id,
        [reading.bssid for reading in readings],
        [reading.ssid for reading in readings],
        np.array([reading.rssi for reading in readings], dtype=np.float32),
        [reading.frequency for reading in readings],
        np.array([reading.age for reading in readings], dtype=np.float32),
    )


def _read_static_transforms(message: Message) -> StaticTransforms:
    read = _read_moving_transforms(message)
    return StaticTransforms(read.stamp_ns, read.transforms)


def _read_moving_transforms(message: Message) -> MovingTransforms:
    check_count("transforms", len(message.transforms), MAX_TRANSFORMS)
    stamps = tuple(map(_header_stamp_ns, message.transforms))
    transforms = tuple(map(_read_transform, message.transforms))
    return MovingTransforms(stamps[0] if stamps else 0, transforms, stamps)


def _read_fix(message: Message) -> PoseFix:
    return PoseFix(*_read_outside_pose(message))


def _read_initial_pose(message: Message) -> InitialPose:
    return InitialPose(*_read_outside_pose(message))


def _read_outside_pose(message: Message) -> tuple[int, Pose2, NDArray[np.float64] | None, str]:
    """The fields of a pose from outside. Raises CodecError for one that lies on its side."""
    position, q = message.pose.pose.position, message.pose.pose.orientation
    rotation = q.x, q.y, q.z, q.w
    if tilt(rotation) > MAX_TILT_RAD:
        raise CodecError(f"the pose is tilted by {tilt(rotation):.2f} rad; give that of the base, z up")
    planar = message.pose.covariance[PLANAR_INDICES].reshape(3, 3)
    covariance = planar if planar.any() else None
    return (
        _header_stamp_ns(message),
        Pose2(position.x, position.y, heading(rotation)),
        covariance,
        message.header.frame_id,
    )


def _read_transform(message: Message) -> Transform:
    t, q = message.transform.translation, message.transform.rotation
    child = check_name(message.child_frame_id)
    return Transform(message.header.frame_id, child, (t.x, t.y, t.z), (q.x, q.y, q.z, q.w))


_READERS: dict[Sensor, Callable[[Message], Measurement]] = {
    Sensor.ODOM: _read_odometry,
    Sensor.SCAN: _read_laser_scan,
    Sensor.POINTS: _read_point_cloud,
    Sensor.WIFI: _read_wifi_scan,
    Sensor.TF_STATIC: _read_static_transforms,
    Sensor.TF: _read_moving_transforms,
    Sensor.FIX: _read_fix,
    Sensor.INITIAL_POSE: _read_initial_pose,
}
