"""Recordings as rosbag2, ROS 1 and CARMEN have them, of the records of another recording."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer

from wayfi.frontends.measurements import SECOND_NS, LaserScan, Odometry, Sensor
from wayfi.recordings.mcap.blocks import Record
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS, TYPESTORE
from wayfi.recordings.ros.topics import Encoding


def rosbag2(path: Path, records: Iterable[Record], storage: StoragePlugin, mode: CompressionMode) -> Path:
    """A folder as `ros2 bag record` makes it."""
    writer = Ros2Writer(path, version=9, storage_plugin=storage)
    if mode is not CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for r in records:
            if r.topic not in connections:
                connections[r.topic] = writer.add_connection(r.topic, r.type_name, typestore=TYPESTORE)
            writer.write(connections[r.topic], r.log_time_ns, r.data)
    return path


def ros1_bag(path: Path, records: Iterable[Record], compression: str = "none") -> Path:
    """A bag as `rosbag record` makes it, in chunks of 100 kB."""
    writer = Ros1Writer(path)
    writer.chunk_threshold = 100_000
    if compression != "none":
        writer.set_compression(Ros1Writer.CompressionFormat[compression.upper()])
    with writer:
        connections: dict[str, Any] = {}
        for r in records:
            if r.topic not in connections:
                definition, md5sum = TYPESTORE.generate_msgdef(r.type_name)
                connections[r.topic] = writer.add_connection(r.topic, r.type_name, msgdef=definition, md5sum=md5sum)
            writer.write(connections[r.topic], r.log_time_ns, TYPESTORE.cdr_to_ros1(r.data, r.type_name))
    return path


def carmen_log(path: Path, records: Iterable[Record], laser_m: float = 0.0) -> Path:
    """A log of the odometry and the scans, the laser `laser_m` ahead of the robot's middle."""
    sensors = {topic: sensor for sensor, topic in DEFAULT_TOPICS.items()}
    x = y = theta = 0.0
    lines = ["# CARMEN Logfile", f"PARAM robot_frontlaser_offset {laser_m} nohost 0"]
    for r in records:
        m = (
            decode(r.data, sensors[r.topic], Encoding.CDR)
            if sensors.get(r.topic) in (Sensor.ODOM, Sensor.SCAN)
            else None
        )
        if isinstance(m, Odometry):
            x, y, theta = m.pose.x, m.pose.y, m.pose.theta
            lines.append(f"ODOM {x:.6f} {y:.6f} {theta:.6f} 0 0 0 {_times(m.stamp_ns, r.log_time_ns)}")
        elif isinstance(m, LaserScan):
            laser = f"{x + laser_m * math.cos(theta):.6f} {y + laser_m * math.sin(theta):.6f} {theta:.6f}"
            robot = f"{x:.6f} {y:.6f} {theta:.6f}"
            ranges = " ".join(f"{min(float(value), 81.83):.3f}" for value in m.ranges)
            angles = f"0 {m.angle_min} {len(m.ranges) * m.angle_increment} {m.angle_increment} {m.range_max_m} 0.01 0"
            scan = f"ROBOTLASER1 {angles} {len(m.ranges)} {ranges} 0"
            lines.append(f"{scan} {laser} {robot} 0 0 0.5 0.5 1e6 {_times(m.stamp_ns, r.log_time_ns)}")
    path.write_text("\n".join(lines) + "\n")
    return path


def _times(stamp_ns: int, log_time_ns: int) -> str:
    return f"{stamp_ns / SECOND_NS:.6f} robot {log_time_ns / SECOND_NS:.6f}"
