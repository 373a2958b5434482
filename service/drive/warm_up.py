"""A short simulated drive before the real one: code that is compiled or loaded at first use is ready afterwards.

numba compiles 40 functions, and 135 of its own for them, in 22 s on a free core and in a minute on a busy machine: once
for each machine, user and version of the sources. Loading them takes 1 s. None is compiled for two types of array, so
fewer signatures would save nothing; a quarter of the time goes into three calls of numpy (solve, argsort, sort).
`wayfi warm-up` compiles at installation. numba keeps the code in NUMBA_CACHE_DIR, else next to the sources, else in the
user's cache where the sources cannot be written.
"""

from collections.abc import Callable, Iterator
from functools import cache

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.closures.closure_config import ConsensusConfig
from wayfi.frontends.closures.consensus import Pairs, best_hypothesis, headings_of
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.measurements import LaserScan, Measurement, Odometry, PointCloud, Sensor, WifiScan
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior
from wayfi.recordings.log import NullLog
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import Config
from wayfi.service.drive.drive import Drive
from wayfi.service.process.compilation import watch_compilation

STEPS = 80
STEP_M = 0.5
STEP_NS = 200_000_000
TURN_AROUND = 10  # steps to the middle, and as many back
BEAMS = 360
BEARINGS = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False)
ROOM_M = 8.0
HEIGHTS_M = np.linspace(0.3, 1.7, 8)

Sense = Callable[[int, float], tuple[Sensor, Measurement]]


@cache
def warm_up(in_map: bool = False) -> None:
    """Feed the simulated drive to a pipeline of its own, and discard it; once in each process.

    A drive in the map of the first follows for those that begin `in_map`, else the first message there that searches
    loads 40 to 60 ms of code. Where the first had to be compiled, it follows as well, and so does one with a 3D LiDAR.
    """
    compiled = []
    with watch_compilation(lambda number, _: compiled.append(number)):
        building = _drive(_scan)
        _search()
    if compiled or in_map:
        _drive(_scan, building)
    if compiled:
        _drive(_cloud)
        _drive(_scan, building, extends=True)


def _drive(sense: Sense, known: BuildingMap | None = None, extends: bool = False) -> BuildingMap:
    drive = Drive(Config(), None, NullLog(), known, extends)
    for sensor, measurement in _measurements(sense):
        drive.feed(sensor, Encoding.CDR, encode(measurement))
    return drive.finish().building


def _search() -> None:
    """Search a turn bias, which the drive is too short for."""
    one, place = np.zeros(1, np.int64), np.zeros((1, 2))
    pairs = Pairs(one, one + 1, place, place, np.ones(1), np.ones(1), np.ones(1))
    headings = headings_of([], np.zeros((2, 3)), ConsensusConfig().no_axes)
    prior = calibration_prior(OdometryConfig())
    best_hypothesis(
        np.zeros((1, 5)),
        np.full((1, 3), np.nan),
        pairs,
        headings,
        prior,
        ConsensusConfig(),
    )


def _measurements(sense: Sense) -> Iterator[tuple[Sensor, Measurement]]:
    """A robot that drives to the middle of a square room and back, until WiFi may close a loop."""
    for i in range(STEPS):
        stamp_ns = (i + 1) * STEP_NS
        x = STEP_M * abs((i + TURN_AROUND) % (2 * TURN_AROUND) - TURN_AROUND)
        yield Sensor.ODOM, Odometry(stamp_ns, Pose2(x, 0.0, 0.0))
        yield sense(stamp_ns, x)
        if i % 2 == 0:
            yield Sensor.WIFI, _wifi(stamp_ns, x)


def _scan(stamp_ns: int, x: float) -> tuple[Sensor, LaserScan]:
    ranges = _ranges(x).astype(np.float32)
    return Sensor.SCAN, LaserScan(stamp_ns, "base_link", ranges, -np.pi, 2 * np.pi / BEAMS, 0.1, 30.0)


def _cloud(stamp_ns: int, x: float) -> tuple[Sensor, PointCloud]:
    wall = _ranges(x)[:, None] * np.stack([np.cos(BEARINGS), np.sin(BEARINGS)], axis=1)
    points = np.concatenate([np.c_[wall, np.full(BEAMS, height)] for height in HEIGHTS_M]).astype(np.float32)
    time_s = np.tile(np.linspace(0.0, 0.09, BEAMS, dtype=np.float32), len(HEIGHTS_M))
    return Sensor.POINTS, PointCloud(stamp_ns, "base_link", points, time_s)


def _ranges(x: float) -> Floats:
    with np.errstate(divide="ignore"):
        to_side = np.abs(ROOM_M / np.sin(BEARINGS))
        to_end = np.where(np.cos(BEARINGS) > 0, ROOM_M - x, ROOM_M + x) / np.abs(np.cos(BEARINGS))
    return np.minimum(to_side, to_end)


def _wifi(stamp_ns: int, x: float) -> WifiScan:
    bssids = tuple(f"02:00:00:00:00:{i:02x}" for i in range(10))
    rssi = np.linspace(-80.0, -40.0, 10, dtype=np.float32) + np.float32(x)
    return WifiScan(stamp_ns, "warm_up", bssids, rssi, np.zeros(10, np.float32))
