"""What a caller hands in, checked before it goes to the pipeline: one clear error for each thing that cannot be right.

A recording's message that is broken is dropped and counted; a caller who mixes up units is told.
"""

import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Pose2, wrap
from wayfi.frontends.frames.frame_tree import FURTHEST_M, LARGEST_NORM, SMALLEST_NORM
from wayfi.frontends.intake.scan_queue import LONGEST_SWEEP_S
from wayfi.frontends.measurements import (
    SECOND_NS,
    LaserScan,
    Odometry,
    PointCloud,
    StaticTransforms,
    Transform,
    WifiScan,
)
from wayfi.frontends.wifi import readings
from wayfi.frontends.wifi.readings import BSSID, HIGHEST_DBM, LOWEST_DBM
from wayfi.recordings.ros.point_layout import MAX_POINTS
from wayfi.recordings.ros.ros_measurements import MAX_BEAMS, MAX_NAME, MAX_READINGS

LATEST_NS = 2**31 * SECOND_NS  # what a ROS time can hold
WHOLE_TURN_RAD = 2.1 * math.pi  # and a little more, for drivers that count one beam too many
LARGEST_TIME_S = 1.0  # between a cloud's stamp and one of its points
FURTHEST_RETURN_M = 300.0  # no LiDAR on a robot measures further: most returns of a scan in mm seem to be
LARGEST_AGE_S = 200.0  # wpa_supplicant forgets an access point after 180 s
SHOWN = 80  # letters of a value in an error


class ArgumentError(WayfiError):
    """Says which argument cannot be used, what it must be and what it is."""


def odometry_of(t_ns: object, x: object, y: object, theta: object) -> Odometry:
    """The odometry with these values. Raises ArgumentError.

    theta may be of any number of turns, so degrees cannot be told from radians.
    """
    angle = number(theta, "theta", "a finite angle in radians")
    T_odom_base = Pose2(number(x, "x"), number(y, "y"), angle if -math.pi <= angle < math.pi else wrap(angle))
    return Odometry(stamp_of(t_ns), T_odom_base)


def scan_of(
    t_ns: object,
    ranges: object,
    angle_min: object,
    angle_increment: object,
    range_min: object,
    range_max: object,
    time_increment: object,
    frame_id: object,
) -> LaserScan:
    """The scan with these values, `ranges` copied. Raises ArgumentError."""
    beams = _floats(ranges, "ranges", "one number for each beam, (n,) in m", 1, MAX_BEAMS)
    _check_metres(beams, "ranges", ranges)
    start = number(angle_min, "angle_min")
    step = number(angle_increment, "angle_increment", "the radians from one beam to the next, not 0")
    if step == 0.0:
        raise _refusal("angle_increment", "the radians from one beam to the next, not 0", angle_increment)
    if abs(step) * len(beams) > WHOLE_TURN_RAD:
        seen = f"{len(beams)} beams would make {abs(step) * len(beams) / (2 * math.pi):.1f} turns: are these degrees?"
        raise _refusal("angle_increment", "in radians", angle_increment, seen)
    if abs(start) > WHOLE_TURN_RAD:
        raise _refusal("angle_min", "in radians, a turn at most", angle_min, "are these degrees?")
    nearest, furthest = _range_limits(range_min, range_max)
    pause = number(time_increment, "time_increment", "the seconds from one beam to the next, 0 if unknown")
    if not 0.0 <= pause * len(beams) <= LONGEST_SWEEP_S:
        wanted = f"the seconds from one beam to the next, at most {LONGEST_SWEEP_S:g} s for {len(beams)} beams"
        raise _refusal("time_increment", wanted, time_increment)
    return LaserScan(stamp_of(t_ns), name(frame_id, "frame_id"), beams, start, step, nearest, furthest, pause)


def cloud_of(t_ns: object, points: object, point_times: object, frame_id: object) -> PointCloud:
    """The cloud with these values, arrays copied. Raises ArgumentError."""
    xyz = _floats(points, "points", "one row x, y, z for each point, (n, 3) in m", 2, MAX_POINTS)
    if xyz.shape[1] != 3:
        raise _refusal("points", "one row x, y, z for each point, (n, 3) in m", points)
    _check_metres(np.abs(xyz).max(axis=1), "points", points)
    times = None
    if point_times is not None:
        wanted = f"the seconds from t_ns to each point, ({len(xyz)},), {LARGEST_TIME_S:g} s at most"
        times = _floats(point_times, "point_times", wanted, 1, MAX_POINTS)
        if len(times) != len(xyz) or not (np.abs(times) <= LARGEST_TIME_S).all():
            raise _refusal("point_times", wanted, point_times)
    return PointCloud(stamp_of(t_ns), name(frame_id, "frame_id"), xyz, times)


def wifi_of(t_ns: object, rssi: object, receiver: object, age: object) -> WifiScan:
    """The WiFi scan of a mapping from BSSID to dBm; `age` (s) is one for all or a mapping. Raises ArgumentError."""
    if not isinstance(rssi, Mapping):
        raise _refusal("rssi", "a mapping from BSSID to dBm", rssi)
    if len(rssi) > MAX_READINGS:
        raise _refusal("rssi", f"of {MAX_READINGS} access points at most", len(rssi))
    bssids = tuple(map(bssid_of, rssi))
    if len(set(bssids)) < len(bssids):
        twice = next(b for b in bssids if bssids.count(b) > 1)
        raise _refusal("rssi", "one number for each BSSID", twice, "it is there twice, in two spellings")
    dbm = np.array([_dbm(bssid, value) for bssid, value in rssi.items()], np.float32)
    ages = np.array(_ages(age, bssids), np.float32)
    return WifiScan(stamp_of(t_ns), name(receiver, "receiver"), bssids, dbm, ages)


def mount_of(mount: object, frame_id: object) -> StaticTransforms:
    """The transform from base_link to `frame_id`.

    `mount` is (x, y, theta), or (x, y, z, qx, qy, qz, qw) for a laser that is tilted, upside down or 3D; m and rad.
    Raises ArgumentError.
    """
    wanted = "(x, y, theta) or (x, y, z, qx, qy, qz, qw) on base_link, in m and rad"
    values = [number(v, "mount", wanted) for v in mount] if isinstance(mount, Iterable) else []
    if len(values) == 3:
        x, y, theta = values
        if abs(theta) > WHOLE_TURN_RAD:
            raise _refusal("mount", wanted, mount, "is its theta in degrees?")
        values = [x, y, 0.0, 0.0, 0.0, math.sin(theta / 2), math.cos(theta / 2)]
    norm = math.hypot(*values[3:])
    if len(values) != 7 or math.hypot(*values[:3]) > FURTHEST_M or not SMALLEST_NORM <= norm <= LARGEST_NORM:
        raise _refusal("mount", wanted, mount)
    x, y, z, qx, qy, qz, qw = values
    transform = Transform("base_link", name(frame_id, "frame_id"), (x, y, z), (qx, qy, qz, qw))
    return StaticTransforms(0, (transform,))


def bssid_of(bssid: object) -> str:
    """The BSSID in lower-case colon hex. Raises ArgumentError."""
    text = readings.bssid_of(bssid) if isinstance(bssid, str) else ""
    if not BSSID.fullmatch(text):
        raise _refusal("rssi", "keyed by BSSIDs such as aa:bb:cc:dd:ee:ff", bssid, "an SSID is not unique")
    return text


def stamp_of(t_ns: object) -> int:
    """The stamp as an int. Raises ArgumentError."""
    if isinstance(t_ns, bool) or not isinstance(t_ns, int | np.integer):
        hint = "seconds become nanoseconds by round(t * 1e9)" if isinstance(t_ns, float | np.floating) else ""
        raise _refusal("t_ns", "an int of nanoseconds", t_ns, hint)
    stamp_ns = int(t_ns)
    if not 0 <= stamp_ns < LATEST_NS:
        raise _refusal("t_ns", f"nanoseconds from 0 to {LATEST_NS}", t_ns)
    return stamp_ns


def number(value: object, argument: str, wanted: str = "a finite number") -> float:
    """`value` as a float. Raises ArgumentError."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.number) or np.iscomplexobj(value):
        raise _refusal(argument, wanted, value)
    if not math.isfinite(value):
        raise _refusal(argument, wanted, value)
    return float(value)


def name(value: object, argument: str) -> str:
    """`value` as the name of a frame or receiver. Raises ArgumentError."""
    if not isinstance(value, str) or not 0 < len(value) <= MAX_NAME:
        raise _refusal(argument, f"a name of 1 to {MAX_NAME} letters", value)
    return value


def path_of(value: object, argument: str) -> Path:
    """`value` as a path. Raises ArgumentError."""
    if not isinstance(value, str | os.PathLike) or not isinstance(text := os.fspath(value), str) or not text:
        raise _refusal(argument, "a path", value)
    return Path(text)


def _range_limits(range_min: object, range_max: object) -> tuple[float, float]:
    nearest = number(range_min, "range_min")
    furthest = math.inf if range_max == math.inf else number(range_max, "range_max", "a number of m, or inf")
    if not 0.0 <= nearest < furthest:
        raise _refusal("range_max", f"more than range_min, which must be 0 or more and is {nearest:g}", range_max)
    return nearest, furthest


def _floats(values: object, argument: str, wanted: str, dimensions: int, most: int) -> NDArray[np.float32]:
    """A float32 copy of an array-like of one or more real numbers, NaN where it is masked.

    NaN and inf are let through.
    """
    if isinstance(values, np.ma.MaskedArray) and values.dtype.kind in "fiu":
        values = np.ma.filled(values.astype(np.float64), np.nan)
    try:
        array = np.asarray(values)
    except ValueError:
        raise _refusal(argument, wanted, values, "its rows differ in length") from None
    if array.dtype.kind not in "fiu" or array.ndim != dimensions or not 0 < len(array) <= most:
        raise _refusal(argument, wanted, values)
    with np.errstate(over="ignore"):
        return np.array(array, np.float32)


def _check_metres(distances: NDArray[np.float32], argument: str, given: object) -> None:
    """Raise ArgumentError where most of `distances` (n,) are impossible in m, and differ.

    Drivers that have one large number for "no return" give the same in all those beams.
    """
    returns = distances[np.isfinite(distances) & (distances > 0.0)]
    far = returns[returns > FURTHEST_RETURN_M]
    if 2 * len(far) > len(returns) and far.min() < far.max():
        raise _refusal(argument, "in m", given, f"most are over {FURTHEST_RETURN_M:g}: are these mm?")


def _dbm(bssid: object, value: object) -> float:
    wanted = f"from {LOWEST_DBM:g} to {HIGHEST_DBM:g} dBm"
    dbm = number(value, f"rssi of {bssid}", wanted)
    if dbm > HIGHEST_DBM:
        raise _refusal(f"rssi of {bssid}", wanted, value, "is it in per cent, or its sign lost?")
    if dbm < LOWEST_DBM:
        raise _refusal(f"rssi of {bssid}", wanted, value)
    return dbm


def _ages(age: object, bssids: tuple[str, ...]) -> list[float]:
    """The age of each reading, one number for all or a mapping; 0 where it is not given."""
    wanted = f"the seconds from a reading to t_ns, 0 to {LARGEST_AGE_S:g}: one number, or a mapping from BSSID"
    given = {bssid_of(b): a for b, a in age.items()} if isinstance(age, Mapping) else dict.fromkeys(bssids, age)
    ages = [number(given.get(b) or 0.0, "age", wanted) for b in bssids]
    for seconds in ages:
        if not 0.0 <= seconds <= LARGEST_AGE_S:
            raise _refusal("age", wanted, seconds, "is it in milliseconds?" if seconds > 0.0 else "")
    return ages


def _refusal(argument: str, wanted: str, value: Any, hint: str = "") -> ArgumentError:  # noqa: ANN401 - whatever came
    shown = f"{type(value).__name__} of shape {value.shape}" if isinstance(value, np.ndarray) else repr(value)
    shown = shown if len(shown) <= SHOWN else f"{shown[:SHOWN]}..."
    return ArgumentError(f"{argument}: must be {wanted}; it is {shown}{f' ({hint})' if hint else ''}")
