"""One simulated run: a world, a drive through it, and everything the sensors say, in order of time.

Every part draws from a random stream of its own, so that a change to one sensor leaves the others as they were.
"""

import heapq
import math
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Pose2, compose_all
from wayfi.frontends.measurements import (
    LaserScan,
    Measurement,
    Odometry,
    StaticTransform,
    StaticTransforms,
    WifiScan,
)
from wayfi.recordings.simulation import laser, radio, returns, wheels
from wayfi.recordings.simulation.drive import TrueMotion, drive
from wayfi.recordings.simulation.people import people
from wayfi.recordings.simulation.roughness import roughened
from wayfi.recordings.simulation.surfaces import Surfaces, join
from wayfi.recordings.simulation.worlds import BLUEPRINTS, Blueprint, World
from wayfi.recordings.trajectory import Trajectory

EPOCH_NS = 1_700_000_000_000_000_000
ODOM_PERIOD_NS = 100_000_000
SCAN_DELAY_NS = 30_000_000
WIFI_PERIOD_NS, WIFI_DELAYS_NS = 2_000_000_000, (70_000_000, 1_070_000_000)
T_BASE_LASER = Pose2(0.2, 0.0, 0.0)
LASER_HEIGHT_M = 0.25
SCANS_AT_ONCE = 100

Stamps = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What happens in the first `length_ns` of a drive; `truth` has base_link's pose at each odometry stamp.

    In a `rough` run a sweep takes its time, walls are bumpy, some of glass or black, people walk about, beams fail or
    mix, and wheels slip; in an ideal one a sweep takes no time, and there is noise alone.
    """

    seed: int
    rough: bool
    length_ns: int
    drive: TrueMotion
    surfaces: Surfaces
    laser: laser.LaserSpec
    wheels: wheels.WheelErrors
    ether: radio.Ether
    phones: tuple[radio.Phone, ...]
    truth: Trajectory


def start(world: World, seed: int, minutes: float | None = None, rough: bool = True) -> Run:
    """The run through `world` that `seed` gives, cut after `minutes` (None: all of it), rough or ideal."""
    blueprint = BLUEPRINTS[world]
    way = drive(blueprint.route, stream(seed, "drive"))
    length_ns = int(min(way.duration_s, np.inf if minutes is None else minutes * 60) * 1e9)
    stamps = EPOCH_NS + np.arange(0, length_ns + 1, ODOM_PERIOD_NS)
    return Run(
        seed,
        rough,
        length_ns,
        way,
        _surfaces(blueprint, way, seed, rough),
        blueprint.laser,
        wheels.draw_wheels(stream(seed, "wheels")),
        radio.draw_ether(blueprint.radio, way.duration_s, stream(seed, "ether")),
        radio.draw_phones(stream(seed, "phones")),
        Trajectory(stamps, way.poses(_seconds(stamps))),
    )


def _surfaces(blueprint: Blueprint, way: TrueMotion, seed: int, rough: bool) -> Surfaces:
    ideal = blueprint.surfaces(way, stream(seed, "surfaces"))
    if not rough:
        return ideal
    walking = people(way, blueprint.aisle_m, stream(seed, "people"))
    return join([roughened(ideal, stream(seed, "roughness")), walking])


def stream(seed: int, name: str) -> np.random.Generator:
    """The random numbers of the part `name`; other names' numbers are independent of them."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(zlib.crc32(name.encode()),)))


def measurements(run: Run) -> Iterator[Measurement]:
    """Everything the robot receives in `run`, by stamp."""
    sensors: list[Iterator[Measurement]] = [
        mount("laser", T_BASE_LASER, LASER_HEIGHT_M),
        odometry(run),
        scans(run),
        wifi_scans(run),
    ]
    return heapq.merge(*sensors, key=_stamp_ns)


def mount(frame: str, T_base_sensor: Pose2, height_m: float) -> Iterator[Measurement]:
    """Where a sensor is mounted, upright and `height_m` above the floor, as /tf_static tells it once."""
    T = T_base_sensor
    turn = (0.0, 0.0, math.sin(T.theta / 2), math.cos(T.theta / 2))
    yield StaticTransforms(EPOCH_NS, (StaticTransform("base_link", frame, (T.x, T.y, height_m), turn),))


def odometry(run: Run) -> Iterator[Odometry]:
    """What the wheels say."""
    truth = run.truth.poses
    slips = wheels.draw_slips(truth, stream(run.seed, "slips")) if run.rough else wheels.no_slips(len(truth) - 1)
    poses = wheels.odometry(truth, ODOM_PERIOD_NS / 1e9, run.wheels, slips, stream(run.seed, "odometry"))
    for stamp_ns, pose in zip(run.truth.stamps_ns.tolist(), poses, strict=True):
        yield Odometry(stamp_ns, Pose2.of(pose))


def scans(run: Run) -> Iterator[LaserScan]:
    """What the laser sees."""
    spec = run.laser
    time_increment_s = spec.time_increment_s if run.rough else 0.0
    stamps = EPOCH_NS + np.arange(SCAN_DELAY_NS, run.length_ns + 1, spec.period_ns)
    batches = (stamps[first : first + SCANS_AT_ONCE] for first in range(0, len(stamps), SCANS_AT_ONCE))
    for batch, ranges in _swept(run, batches):
        for stamp_ns, sweep in zip(batch.tolist(), ranges, strict=True):
            angles, limits = (spec.angle_min, spec.angle_increment), (spec.range_min_m, spec.range_max_m)
            yield LaserScan(stamp_ns, "laser", sweep, *angles, *limits, time_increment_s)


def _swept(run: Run, batches: Iterable[Stamps]) -> Iterator[tuple[Stamps, NDArray[np.float32]]]:
    """The stamps and the ranges (n, beams) of each batch of sweeps."""
    noise, luck = stream(run.seed, "laser"), stream(run.seed, "returns")
    for batch in batches:
        time_s = _seconds(batch)
        if not run.rough:
            yield batch, laser.scans(run.surfaces, _laser_poses(run, time_s), time_s, noise, run.laser)
            continue
        sweep_s, shape = run.laser.sweep_s, (len(batch), run.laser.beams)
        sweeps = laser.Sweeps(time_s, _laser_poses(run, time_s), _laser_poses(run, time_s + sweep_s), sweep_s)
        normal = noise.standard_normal(shape, dtype=np.float32)
        uniform = luck.random((shape[0], returns.LUCK, shape[1]), dtype=np.float32)
        yield batch, returns.scans(run.surfaces, sweeps, run.laser, normal, uniform)


def _laser_poses(run: Run, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    return compose_all(run.drive.poses(time_s), T_BASE_LASER.array())


def wifi_scans(run: Run) -> Iterator[WifiScan]:
    """What the phones hear, in turn."""
    phones = zip(run.phones, WIFI_DELAYS_NS, strict=True)
    return heapq.merge(*(_heard(run, phone, delay_ns) for phone, delay_ns in phones), key=_stamp_ns)


def _heard(run: Run, phone: radio.Phone, delay_ns: int) -> Iterator[WifiScan]:
    rng = stream(run.seed, phone.name)
    for stamp_ns in range(EPOCH_NS + delay_ns, EPOCH_NS + run.length_ns + 1, WIFI_PERIOD_NS):
        yield radio.hear(run.ether, phone, stamp_ns, (stamp_ns - EPOCH_NS) / 1e9, run.drive.poses, rng)


def _stamp_ns(measurement: Measurement) -> int:
    return measurement.stamp_ns


def _seconds(stamps_ns: Stamps) -> NDArray[np.float64]:
    """Seconds into the drive."""
    return np.asarray((stamps_ns - EPOCH_NS) / 1e9)
