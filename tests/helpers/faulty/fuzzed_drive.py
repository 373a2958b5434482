"""A sound drive without an end, and mutations of its latest messages between them."""

import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from faulty.fuzzing import Mutator

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
from wayfi.recordings.ros.topics import Encoding

SENSORS = tuple(Sensor)
SOUND_AT_ONCE, MUTATED_AT_ONCE = 60, 600
CLOUD_POINTS = 200
EVERY_BEAM = 4  # is kept of a scan: small messages are mutated faster


@dataclass(frozen=True, slots=True)
class Fed:
    """One message, and whether it was mutated."""

    sensor: Sensor
    encoding: Encoding
    data: bytes
    mutated: bool


def sensor_of(measurement: Measurement) -> Sensor:
    """The sensor of a measurement."""
    match measurement:
        case Odometry():
            return Sensor.ODOM
        case LaserScan():
            return Sensor.SCAN
        case PointCloud():
            return Sensor.POINTS
        case WifiScan():
            return Sensor.WIFI
        case StaticTransforms():
            return Sensor.TF_STATIC
        case MovingTransforms():
            return Sensor.TF
        case PoseFix():
            return Sensor.FIX
        case InitialPose():
            return Sensor.INITIAL_POSE


def to_and_fro(drive: Sequence[Measurement]) -> Iterator[Measurement]:
    """`drive`, then backwards to where it began, and again; stamps only rise."""
    stamps = [m.stamp_ns for m in drive if not isinstance(m, StaticTransforms)]
    first, last = min(stamps), max(stamps)
    shift_ns = 0
    while True:
        for m in drive:
            yield _stamped(m, m.stamp_ns + shift_ns)
        shift_ns += last - first + 100_000_000
        for m in reversed(drive):
            yield _stamped(m, first + last - m.stamp_ns + shift_ns)
        shift_ns += last - first + 100_000_000


def thinned(m: Measurement) -> Measurement:
    """A scan with fewer beams; anything else as it is."""
    if not isinstance(m, LaserScan):
        return m
    increments = m.angle_increment * EVERY_BEAM, m.time_increment_s * EVERY_BEAM
    return replace(m, ranges=m.ranges[::EVERY_BEAM], angle_increment=increments[0], time_increment_s=increments[1])


def as_cloud(scan: LaserScan) -> PointCloud:
    """A small cloud of what a scan sees, at the height of a 3D LiDAR's band."""
    beams = np.linspace(0, len(scan.ranges) - 1, CLOUD_POINTS).astype(int)
    bearings = scan.angle_min + beams * scan.angle_increment
    ranges = np.nan_to_num(scan.ranges[beams], nan=0.0, posinf=0.0)
    points = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings), np.zeros(CLOUD_POINTS)], axis=1)
    return PointCloud(scan.stamp_ns, scan.frame_id, points.astype(np.float32))


def fuzzed(drive: Sequence[Measurement], messages: int, seed: int) -> Iterator[Fed]:
    """`messages` mutated ones of every type and encoding, with stretches of `drive` before each few hundred."""
    mutator, rng = Mutator(seed), random.Random(seed)
    sound = to_and_fro(drive)
    latest: dict[Sensor, bytes] = {}
    while messages > 0:
        for _ in range(SOUND_AT_ONCE):
            m = next(sound)
            data = encode(m)
            latest[sensor_of(m)] = data
            if isinstance(m, LaserScan):
                latest[Sensor.POINTS] = encode(as_cloud(m))
                latest[Sensor.TF_STATIC] = encode(_mounts(m))
            elif isinstance(m, Odometry):
                latest[Sensor.TF] = encode(as_transforms(m))
                latest |= {sensor_of(pose): encode(pose) for pose in as_outside_poses(m)}
            elif isinstance(m, PointCloud):
                latest[Sensor.SCAN] = encode(_as_scan(m))
                latest[Sensor.TF_STATIC] = encode(_mounts(m))
            yield Fed(sensor_of(m), Encoding.CDR, data, False)
        for _ in range(min(MUTATED_AT_ONCE, messages)):
            sensor = rng.choice(list(latest))
            encoding = Encoding.JSON if rng.random() < 0.3 else Encoding.CDR
            yield Fed(sensor, encoding, mutator.message(sensor, latest[sensor], encoding), True)
        messages -= MUTATED_AT_ONCE


def as_transforms(m: Odometry) -> MovingTransforms:
    """The same pose as transforms, with a mount beside it."""
    half = 0.5 * m.pose.theta
    turn = 0.0, 0.0, math.sin(half), math.cos(half)
    pose = Transform(m.frame_id, m.child_frame_id, (m.pose.x, m.pose.y, 0.0), turn)
    laser = Transform(m.child_frame_id, "laser", (0.2, 0.0, 0.3), (0.0, 0.0, 0.0, 1.0))
    return MovingTransforms(m.stamp_ns, (pose, laser), (m.stamp_ns, m.stamp_ns))


def as_outside_poses(m: Odometry) -> list[Measurement]:
    """The same pose as a fix, and as an initial pose."""
    return [kind(m.stamp_ns, m.pose, np.eye(3)) for kind in (PoseFix, InitialPose)]


def _as_scan(cloud: PointCloud) -> LaserScan:
    ranges = np.hypot(cloud.points[:, 0], cloud.points[:, 1])
    return LaserScan(cloud.stamp_ns, cloud.frame_id, ranges, -np.pi, 2 * np.pi / len(ranges), 0.1, 30.0)


def _mounts(m: LaserScan | PointCloud) -> StaticTransforms:
    turned = Transform("base_link", m.frame_id, (0.2, 0.0, 0.3), (0.0, 0.0, 0.0, 1.0))
    return StaticTransforms(m.stamp_ns, (turned, replace(turned, child_frame_id="other")))


def _stamped(m: Measurement, stamp_ns: int) -> Measurement:
    moved: Any = replace(m, stamp_ns=stamp_ns)
    return moved  # type: ignore[no-any-return]
