"""A recording through `wayfi.Slam`: decoded and handed in by its public methods, as a robot's program would."""

from pathlib import Path

import wayfi
from wayfi.frontends.measurements import (
    LaserScan,
    Measurement,
    Odometry,
    PointCloud,
    StaticTransforms,
    WifiScan,
)
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import route


def stream(recording: Path, slam: wayfi.Slam) -> int:
    """Hand in every message of a recording; returns how many were refused."""
    refused = 0
    for record in open_recording(recording):
        found = route(record.topic, record.type_name, record.encoding, DEFAULT_TOPICS)
        if found.sensor is None or found.encoding is None:
            continue
        try:
            hand_in(decode(record.data, found.sensor, found.encoding), slam)
        except wayfi.ArgumentError:
            refused += 1
    return refused


def hand_in(m: Measurement, slam: wayfi.Slam) -> None:
    """Hand in one measurement."""
    match m:
        case Odometry():
            slam.add_odometry(m.stamp_ns, m.pose.x, m.pose.y, m.pose.theta)
        case LaserScan():
            slam.add_scan(
                m.stamp_ns,
                m.ranges,
                angle_min=m.angle_min,
                angle_increment=m.angle_increment,
                range_min=m.range_min_m,
                range_max=m.range_max_m,
                time_increment=m.time_increment_s,
                frame_id=m.frame_id,
            )
        case PointCloud():
            slam.add_points(m.stamp_ns, m.points, point_times=m.time_s, frame_id=m.frame_id)
        case WifiScan():
            rssi = dict(zip(m.bssids, m.rssi.tolist(), strict=True))
            ages = dict(zip(m.bssids, m.age_s.tolist(), strict=True))
            slam.add_wifi(m.stamp_ns, rssi, receiver=m.receiver, age=ages)
        case StaticTransforms():
            for t in m.transforms:
                if t.frame_id == "base_link":
                    slam.set_mount([*t.translation_xyz, *t.rotation_xyzw], t.child_frame_id)
