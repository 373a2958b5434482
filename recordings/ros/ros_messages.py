"""Converts measurements to ROS messages, which are objects of the typestore's classes."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import (
    SECOND_NS,
    InitialPose,
    LaserScan,
    Measurement,
    MovingTransforms,
    Odometry,
    OutsidePose,
    PointCloud,
    PoseFix,
    StaticTransforms,
    Transform,
    WifiScan,
)
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.messages import (
    LASER_SCAN,
    ODOMETRY,
    PLANAR_INDICES,
    POINT_CLOUD,
    POSE_WITH_COVARIANCE,
    TF_MESSAGE,
    TYPESTORE,
    WIFI_SCAN,
)

Message = Any


def to_message(measurement: Measurement) -> tuple[Message, str]:
    """The ROS message of `measurement`, and its type name.

    Raises CodecError if the lengths of its fields differ, or a ROS time cannot hold its stamp.
    """
    writer, type_name = _WRITERS[type(measurement)]
    return writer(measurement), type_name


def new_message(type_name: str, *values: Any) -> Message:  # noqa: ANN401 - each field has its own type
    """A message of `type_name` with these field values, in the order of its definition."""
    return TYPESTORE.types[type_name](*values)


def header(stamp_ns: int, frame_id: str) -> Message:
    """A std_msgs/Header. Raises CodecError if a ROS time cannot hold `stamp_ns`."""
    if not 0 <= stamp_ns < 2**31 * SECOND_NS:
        raise CodecError(f"stamp of {stamp_ns} ns is out of the range of a ROS time")
    time = new_message("builtin_interfaces/msg/Time", *divmod(stamp_ns, SECOND_NS))
    return new_message("std_msgs/msg/Header", time, frame_id)


def planar_pose(pose: Pose2) -> Message:
    """A geometry_msgs/Pose in the plane."""
    half = 0.5 * pose.theta
    rotation = math.sin(half), math.cos(half)
    return new_message(
        "geometry_msgs/msg/Pose",
        new_message("geometry_msgs/msg/Point", pose.x, pose.y, 0.0),
        new_message("geometry_msgs/msg/Quaternion", 0.0, 0.0, *rotation),
    )


def full_covariance(covariance: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """The (36,) row-major 6 x 6 covariance of a (3, 3) one in (x, y, theta); zeros for None."""
    full = np.zeros(36)
    if covariance is not None:
        full[PLANAR_INDICES] = np.asarray(covariance, dtype=np.float64).reshape(9)
    return full


def pose_with_covariance(pose: Pose2, covariance: NDArray[np.float64] | None) -> Message:
    """A geometry_msgs/PoseWithCovariance in the plane."""
    return new_message("geometry_msgs/msg/PoseWithCovariance", planar_pose(pose), full_covariance(covariance))


def _write_odometry(odometry: Odometry) -> Message:
    vx, vy, omega = odometry.twist
    linear, angular = (new_message("geometry_msgs/msg/Vector3", *v) for v in ((vx, vy, 0.0), (0.0, 0.0, omega)))
    twist = new_message("geometry_msgs/msg/Twist", linear, angular)
    return new_message(
        ODOMETRY,
        header(odometry.stamp_ns, odometry.frame_id),
        odometry.child_frame_id,
        pose_with_covariance(odometry.pose, odometry.covariance),
        new_message("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
    )


def _write_laser_scan(scan: LaserScan) -> Message:
    ranges = np.ascontiguousarray(scan.ranges, dtype=np.float32).reshape(-1)
    last = scan.angle_min + max(len(ranges) - 1, 0) * scan.angle_increment
    return new_message(
        LASER_SCAN,
        header(scan.stamp_ns, scan.frame_id),
        scan.angle_min,
        last if scan.angle_max is None else scan.angle_max,
        scan.angle_increment,
        scan.time_increment_s,
        len(ranges) * scan.time_increment_s if scan.scan_time_s is None else scan.scan_time_s,
        scan.range_min_m,
        scan.range_max_m,
        ranges,
        np.zeros(0, dtype=np.float32),
    )


def _write_point_cloud(cloud: PointCloud) -> Message:
    columns = [np.asarray(cloud.points, dtype="<f4").reshape(-1, 3)]
    if cloud.time_s is not None:
        columns.append(np.asarray(cloud.time_s, dtype="<f4").reshape(-1, 1))
    rows = np.ascontiguousarray(np.hstack(columns))
    names = ("x", "y", "z", "time")[: rows.shape[1]]
    fields = [new_message("sensor_msgs/msg/PointField", name, 4 * i, 7, 1) for i, name in enumerate(names)]
    data = rows.reshape(-1).view(np.uint8)
    head = header(cloud.stamp_ns, cloud.frame_id)
    return new_message(POINT_CLOUD, head, 1, len(rows), fields, False, 4 * len(names), len(data), data, False)


def _write_wifi_scan(scan: WifiScan) -> Message:
    count = len(scan.bssids)
    ssids, frequencies = scan.ssids or ("",) * count, scan.frequency_mhz or (0,) * count
    columns = scan.bssids, ssids, scan.rssi.tolist(), frequencies, scan.age_s.tolist()
    if any(len(column) != count for column in columns):
        raise CodecError(f"WifiScan's fields disagree on its number of readings: {[len(c) for c in columns]}")
    readings = [new_message("wifi_msgs/msg/WifiReading", *values) for values in zip(*columns, strict=True)]
    return new_message(WIFI_SCAN, header(scan.stamp_ns, scan.receiver), readings)


def _write_static_transforms(transforms: StaticTransforms) -> Message:
    written = [_write_transform(transform, transforms.stamp_ns) for transform in transforms.transforms]
    return new_message(TF_MESSAGE, written)


def _write_moving_transforms(transforms: MovingTransforms) -> Message:
    pairs = zip(transforms.transforms, transforms.stamps_ns, strict=True)
    return new_message(TF_MESSAGE, [_write_transform(*pair) for pair in pairs])


def _write_outside_pose(m: OutsidePose) -> Message:
    pose = pose_with_covariance(m.T_map_base, m.covariance)
    return new_message(POSE_WITH_COVARIANCE, header(m.stamp_ns, m.frame_id), pose)


def _write_transform(transform: Transform, stamp_ns: int) -> Message:
    pose = new_message(
        "geometry_msgs/msg/Transform",
        new_message("geometry_msgs/msg/Vector3", *transform.translation_xyz),
        new_message("geometry_msgs/msg/Quaternion", *transform.rotation_xyzw),
    )
    head = header(stamp_ns, transform.frame_id)
    return new_message("geometry_msgs/msg/TransformStamped", head, transform.child_frame_id, pose)


_WRITERS: dict[type, tuple[Any, str]] = {
    Odometry: (_write_odometry, ODOMETRY),
    LaserScan: (_write_laser_scan, LASER_SCAN),
    PointCloud: (_write_point_cloud, POINT_CLOUD),
    WifiScan: (_write_wifi_scan, WIFI_SCAN),
    StaticTransforms: (_write_static_transforms, TF_MESSAGE),
    MovingTransforms: (_write_moving_transforms, TF_MESSAGE),
    PoseFix: (_write_outside_pose, POSE_WITH_COVARIANCE),
    InitialPose: (_write_outside_pose, POSE_WITH_COVARIANCE),
}
