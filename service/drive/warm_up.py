"""A short simulated drive before the real one: code that is compiled or loaded at first use is ready afterwards."""

from collections.abc import Iterator

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import LaserScan, Measurement, Odometry, Sensor, WifiScan
from wayfi.recordings.log import NullLog
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import Config
from wayfi.service.drive.drive import Drive

STEPS = 80
STEP_M = 0.5
STEP_NS = 200_000_000
TURN_AROUND = 10  # steps to the middle, and as many back
BEAMS = 360
ROOM_M = 8.0


def warm_up(config: Config) -> None:
    """Feed the simulated drive to a pipeline of its own, and discard it."""
    drive = Drive(config, None, NullLog())
    for sensor, measurement in _measurements():
        drive.feed(sensor, Encoding.CDR, encode(measurement))
    drive.finish()


def _measurements() -> Iterator[tuple[Sensor, Measurement]]:
    """A robot that drives to the middle of a square room and back, until WiFi may close a loop."""
    for i in range(STEPS):
        stamp_ns = (i + 1) * STEP_NS
        x = STEP_M * abs((i + TURN_AROUND) % (2 * TURN_AROUND) - TURN_AROUND)
        yield Sensor.ODOM, Odometry(stamp_ns, Pose2(x, 0.0, 0.0))
        yield Sensor.SCAN, _scan(stamp_ns, x)
        if i % 2 == 0:
            yield Sensor.WIFI, _wifi(stamp_ns, x)


def _scan(stamp_ns: int, x: float) -> LaserScan:
    angles = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False)
    with np.errstate(divide="ignore"):
        to_side = np.abs(ROOM_M / np.sin(angles))
        to_end = np.where(np.cos(angles) > 0, ROOM_M - x, ROOM_M + x) / np.abs(np.cos(angles))
    ranges = np.minimum(to_side, to_end).astype(np.float32)
    return LaserScan(stamp_ns, "base_link", ranges, -np.pi, 2 * np.pi / BEAMS, 0.1, 30.0)


def _wifi(stamp_ns: int, x: float) -> WifiScan:
    bssids = tuple(f"02:00:00:00:00:{i:02x}" for i in range(10))
    rssi = np.linspace(-80.0, -40.0, 10, dtype=np.float32) + np.float32(x)
    return WifiScan(stamp_ns, "warm_up", bssids, rssi, np.zeros(10, np.float32))
