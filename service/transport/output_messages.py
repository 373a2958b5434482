"""The daemon's output messages in CDR: pose, transform, map and status."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import GridRedrawn, PosePublished
from wayfi.frontends.frames.frames_config import FramesConfig
from wayfi.frontends.measurements import StaticTransforms, Transform
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.messages import DIAGNOSTIC_ARRAY, OCCUPANCY_GRID, POSE_WITH_COVARIANCE, TYPESTORE
from wayfi.recordings.ros.ros_messages import Message, header, new_message, planar_pose, pose_with_covariance

OCCUPIED, FREE, UNKNOWN = 100, 0, -1
OK, WARN, ERROR = 0, 1, 2


def pose_message(event: PosePublished, frames: FramesConfig) -> bytes:
    """A PoseWithCovarianceStamped in `map`. Raises CodecError where a ROS time cannot hold the stamp."""
    head = header(event.stamp_ns, frames.map)
    pose = pose_with_covariance(event.T_map_base, event.covariance)
    return _cdr(new_message(POSE_WITH_COVARIANCE, head, pose), POSE_WITH_COVARIANCE)


def common_pose_message(event: PosePublished, T_common_map: Pose2, frames: FramesConfig) -> bytes:
    """The pose in the map of a fleet, in which the robot's own lies at `T_common_map`; otherwise as `pose_message`."""
    turn = np.eye(3)
    cos, sin = math.cos(T_common_map.theta), math.sin(T_common_map.theta)
    turn[:2, :2] = (cos, -sin), (sin, cos)
    pose = pose_with_covariance(T_common_map @ event.T_map_base, turn @ event.covariance @ turn.T)
    return _cdr(new_message(POSE_WITH_COVARIANCE, header(event.stamp_ns, frames.common), pose), POSE_WITH_COVARIANCE)


def transform_message(
    event: PosePublished, frames: FramesConfig, ahead_ns: int = 0, T_common_map: Pose2 | None = None
) -> bytes:
    """A TFMessage with map -> odom, and the map in that of a fleet if it is known, stamped `ahead_ns` after the pose.

    Raises CodecError where a ROS time cannot hold the stamp.
    """
    transforms = [_transform(frames.map, frames.odom, event.T_map_odom)]
    if T_common_map is not None:
        transforms.append(_transform(frames.common, frames.map, T_common_map))
    return encode(StaticTransforms(event.stamp_ns + ahead_ns, tuple(transforms)))


def _transform(parent: str, child: str, T: Pose2) -> Transform:
    return Transform(parent, child, (T.x, T.y, 0.0), (0.0, 0.0, math.sin(T.theta / 2), math.cos(T.theta / 2)))


def map_message(event: GridRedrawn, config: MapConfig, frame_id: str = "map") -> bytes:
    """An OccupancyGrid in `frame_id`: 100, 0 or -1 for each cell, as Nav2's map_server makes it of the saved map."""
    rows, columns = event.occupancy.shape
    head = header(event.stamp_ns, frame_id)
    origin = planar_pose(Pose2(*event.origin_xy_m, 0.0))
    info = new_message("nav_msgs/msg/MapMetaData", head.stamp, event.resolution_m, columns, rows, origin)
    return _cdr(new_message(OCCUPANCY_GRID, head, info, _cells(event, config)), OCCUPANCY_GRID)


@dataclass(frozen=True, slots=True)
class Status:
    """The diagnostic status named `wayfi`: its level (OK, WARN or ERROR), a message for a person, and the values."""

    level: int
    message: str
    values: Mapping[str, str]


def status_message(stamp_ns: int, status: Status) -> bytes:
    """A DiagnosticArray with this status."""
    values = [new_message("diagnostic_msgs/msg/KeyValue", key, value) for key, value in status.values.items()]
    one = new_message("diagnostic_msgs/msg/DiagnosticStatus", status.level, "wayfi", status.message, "", values)
    return _cdr(new_message(DIAGNOSTIC_ARRAY, header(stamp_ns, ""), [one]), DIAGNOSTIC_ARRAY)


def _cells(event: GridRedrawn, config: MapConfig) -> NDArray[np.int8]:
    cells = np.full(event.occupancy.shape, UNKNOWN, np.int8)
    cells[event.occupancy >= config.occupied_probability] = OCCUPIED
    cells[event.occupancy <= config.free_probability] = FREE
    return cells.ravel()


def _cdr(message: Message, type_name: str) -> bytes:
    return bytes(TYPESTORE.serialize_cdr(message, type_name, little_endian=True))
