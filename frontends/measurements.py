"""Measurements of the sensors, decoded and frozen. Every stamp is in integer nanoseconds, every angle in radians."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Pose2

SECOND_NS = 1_000_000_000
NANOSECOND_S = 1e-9
PAUSE_NS = SECOND_NS  # sensors send every second or more often: a longer step between messages is a pause of their own


class Sensor(StrEnum):
    """The inputs, by the name of their default topic."""

    ODOM = "odom"
    SCAN = "scan"
    POINTS = "points"
    WIFI = "wifi"
    TF_STATIC = "tf_static"
    TF = "tf"
    FIX = "fix"
    INITIAL_POSE = "initialpose"


@dataclass(frozen=True, slots=True, eq=False)
class Odometry:
    """Pose of `child_frame_id` (base_link) in `frame_id` (odom), as the wheels see it; not checked for finiteness.

    `covariance` is (3, 3) in (x, y, theta), m and rad, or None where the message leaves it zero (unknown). `twist` is
    the velocity in `child_frame_id`: x and y, m/s, and theta, rad/s.
    """

    stamp_ns: int
    pose: Pose2
    covariance: NDArray[np.float64] | None = None
    frame_id: str = "odom"
    child_frame_id: str = "base_link"
    twist: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class LaserScan:
    """One LiDAR sweep: `ranges` (n,) float32 in m, beam i at `angle_min + i * angle_increment`.

    `stamp_ns` is the first beam's; beam i is `i * time_increment_s` later (0: unknown). Ranges that are not finite or
    lie outside [range_min_m, range_max_m] are no return. `angle_max` and `scan_time_s` are what the driver says of the
    last beam's bearing and of the time between scans, None where nobody says it; none of the numbers is checked.
    `topic` is the one that the scan came on, empty where that is not known.
    """

    stamp_ns: int
    frame_id: str
    ranges: NDArray[np.float32]
    angle_min: float
    angle_increment: float
    range_min_m: float
    range_max_m: float
    time_increment_s: float = 0.0
    angle_max: float | None = None
    scan_time_s: float | None = None
    topic: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """One 3D LiDAR sweep: `points` (n, 3) float32 in m in `frame_id`; rows that are not finite are no return.

    `time_s` (n,) float32 is when each point was taken, after `stamp_ns` (before it: negative); None: unknown.
    """

    stamp_ns: int
    frame_id: str
    points: NDArray[np.float32]
    time_s: NDArray[np.float32] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class WifiScan:
    """One WiFi sweep of one `receiver`, ended at `stamp_ns`; all fields have one entry a reading.

    `bssids` are lower-case colon hex, as received (not yet checked); `rssi` is (n,) float32 in dBm; `age_s` is (n,)
    float32, the seconds between a reading and the stamp (0: unknown).
    """

    stamp_ns: int
    receiver: str
    bssids: tuple[str, ...]
    rssi: NDArray[np.float32]
    age_s: NDArray[np.float32]
    ssids: tuple[str, ...] = ()
    frequency_mhz: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Transform:
    """Pose of `child_frame_id` in `frame_id`: translation x, y, z (m) and rotation as a quaternion x, y, z, w."""

    frame_id: str
    child_frame_id: str
    translation_xyz: tuple[float, float, float]
    rotation_xyzw: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class StaticTransforms:
    """The transforms of one /tf_static message."""

    stamp_ns: int
    transforms: tuple[Transform, ...]


@dataclass(frozen=True, slots=True)
class MovingTransforms:
    """The transforms of one /tf message, each with its stamp in `stamps_ns`; some may be fixed all the same."""

    stamp_ns: int
    transforms: tuple[Transform, ...]
    stamps_ns: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class PoseFix:
    """Pose of the base in `frame_id` (map) that something outside measured: a fiducial, a dock, a surveyor.

    `covariance` is (3, 3) in (x, y, theta) of `frame_id`, m and rad, or None where the message leaves it zero
    (unknown). Neither is checked for finiteness. A stamp of 0 means now.
    """

    stamp_ns: int
    T_map_base: Pose2
    covariance: NDArray[np.float64] | None = None
    frame_id: str = "map"


@dataclass(frozen=True, slots=True, eq=False)
class InitialPose:
    """Pose of the base in `frame_id` (map) that somebody believes, as RViz and Nav2 send it; fields as of PoseFix."""

    stamp_ns: int
    T_map_base: Pose2
    covariance: NDArray[np.float64] | None = None
    frame_id: str = "map"


Sweep = LaserScan | PointCloud
OutsidePose = PoseFix | InitialPose
Measurement = Odometry | LaserScan | PointCloud | WifiScan | StaticTransforms | MovingTransforms | OutsidePose


def content_of(m: LaserScan | PointCloud | WifiScan) -> bytes:
    """What was measured, the stamp left out."""
    match m:
        case LaserScan():
            return m.ranges.tobytes()
        case PointCloud():
            return m.points.tobytes()
        case WifiScan():
            return m.rssi.tobytes() + " ".join(m.bssids).encode("utf-8", "replace")
