"""A simulated run: a world, a drive through it, and the measurements of all sensors, sorted by time.

Every part has a random stream of its own, so that a change to one sensor does not affect the others.
"""

import heapq
import math
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Pose2, compose_all
from wayfi.frontends.measurements import (
    SECOND_NS,
    LaserScan,
    Measurement,
    Odometry,
    StaticTransforms,
    Transform,
    WifiScan,
)
from wayfi.recordings.simulation import laser, radio, returns, wheels
from wayfi.recordings.simulation.drive import RoutePlan, TrueMotion, drive
from wayfi.recordings.simulation.people import people
from wayfi.recordings.simulation.robots.bias_walk import wandering_bias
from wayfi.recordings.simulation.robots.ground import scales_of_the_ground
from wayfi.recordings.simulation.robots.lasers import draw_laser
from wayfi.recordings.simulation.robots.models import MODELS, Robot
from wayfi.recordings.simulation.robots.mounting import draw_mount
from wayfi.recordings.simulation.roughness import roughened
from wayfi.recordings.simulation.surfaces import Surfaces, join
from wayfi.recordings.simulation.worlds.blueprints import BLUEPRINTS, Blueprint, World
from wayfi.recordings.trajectory import Trajectory

EPOCH_NS = 1_700_000_000_000_000_000
ODOM_PERIOD_NS = 100_000_000
SCAN_DELAY_NS = 30_000_000
WIFI_PERIOD_NS, WIFI_DELAYS_NS = 2_000_000_000, (70_000_000, 1_070_000_000)
EQUAL_STAMPS = 0.5  # of the typical and cheap robots stamp scans like odometry
TURNS_ON_THE_SPOT = 0.5  # of the drives have them
T_BASE_LASER = Pose2(0.2, 0.0, 0.0)
LASER_HEIGHT_M = 0.25
SCANS_AT_ONCE = 100

Stamps = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """The first `length_ns` of a drive; `truth` has the pose of base_link at each odometry stamp.

    In a rough run, scans are distorted by motion, walls are bumpy, some are glass or black, people walk by, beams get
    lost or mixed, and wheels slip. In an ideal run there is only noise, and scans take no time.
    """

    seed: int
    rough: bool
    length_ns: int
    drive: TrueMotion
    surfaces: Surfaces
    laser: laser.LaserSpec
    T_base_laser: Pose2
    scan_delay_ns: int
    wheels: wheels.WheelErrors
    environment: radio.RadioEnvironment
    receivers: tuple[radio.SimulatedReceiver, ...]
    truth: Trajectory


def start(world: World, seed: int, minutes: float | None = None, robot: Robot = Robot.TYPICAL) -> Run:
    """The run of `robot` through `world` with `seed`, cut after `minutes` (None: full length).

    Drive and WiFi depend on the seed alone; the robot decides how scans and odometry err, and what is around it.
    """
    blueprint, model = BLUEPRINTS[world], MODELS[robot]
    motion = drive(_route(blueprint, seed), stream(seed, "drive"))
    rough = model.laser is not None
    length_ns = int(min(motion.duration_s, np.inf if minutes is None else minutes * 60) * SECOND_NS)
    stamps = EPOCH_NS + np.arange(0, length_ns + 1, ODOM_PERIOD_NS)
    return Run(
        seed,
        rough,
        length_ns,
        motion,
        _surfaces(blueprint, motion, seed, rough),
        draw_laser(blueprint.laser, model.laser, stream(seed, "laser flaws")) if model.laser else blueprint.laser,
        draw_mount(stream(seed, "mount")) if rough else T_BASE_LASER,
        0 if rough and stream(seed, "stamps").random() < EQUAL_STAMPS else SCAN_DELAY_NS,
        wheels.draw_wheels(model.wheels, stream(seed, "wheels")),
        radio.draw_radio(blueprint.radio, motion.duration_s, stream(seed, "ether")),
        radio.draw_receivers(stream(seed, "phones")),
        Trajectory(stamps, motion.poses(_seconds(stamps))),
    )


def _route(blueprint: Blueprint, seed: int) -> RoutePlan:
    """The route of a drive, and whether the robot turns on the spot."""
    route = blueprint.other_route if seed % 2 and blueprint.other_route else blueprint.route
    return replace(route, on_the_spot=bool(stream(seed, "turns").random() < TURNS_ON_THE_SPOT))


def _surfaces(blueprint: Blueprint, motion: TrueMotion, seed: int, rough: bool) -> Surfaces:
    ideal = blueprint.surfaces(motion, stream(seed, "surfaces"))
    if not rough:
        return ideal
    walking = people(motion, blueprint.aisle_m, stream(seed, "people"))
    return join([roughened(ideal, stream(seed, "roughness")), walking])


def stream(seed: int, name: str) -> np.random.Generator:
    """The random generator of the part `name`, independent of those of other names."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(zlib.crc32(name.encode()),)))


def measurements(run: Run) -> Iterator[Measurement]:
    """All measurements in `run`, sorted by stamp."""
    sensors: list[Iterator[Measurement]] = [
        mount("laser", run.T_base_laser, LASER_HEIGHT_M),
        odometry(run),
        scans(run),
        wifi_scans(run),
    ]
    return heapq.merge(*sensors, key=_stamp_ns)


def mount(frame: str, T_base_sensor: Pose2, height_m: float) -> Iterator[Measurement]:
    """The static transform of a sensor, upright and `height_m` above the floor; one measurement, at the start."""
    T = T_base_sensor
    turn = (0.0, 0.0, math.sin(T.theta / 2), math.cos(T.theta / 2))
    yield StaticTransforms(EPOCH_NS, (Transform("base_link", frame, (T.x, T.y, height_m), turn),))


def odometry(run: Run) -> Iterator[Odometry]:
    """The wheel odometry."""
    period_s = ODOM_PERIOD_NS / SECOND_NS
    errors = _step_errors(run, period_s)
    poses = wheels.odometry(run.truth.poses, period_s, run.wheels, errors, stream(run.seed, "odometry"))
    for stamp_ns, pose in zip(run.truth.stamps_ns.tolist(), poses, strict=True):
        yield Odometry(stamp_ns, Pose2.of(pose))


def _step_errors(run: Run, period_s: float) -> wheels.StepErrors:
    """What slip, floor and a wandering turn bias add to each step of the odometry, `period_s` long."""
    truth = run.truth.poses
    steps = len(truth) - 1
    if not run.rough:
        return wheels.no_slips(steps)
    slips = wheels.draw_slips(truth, stream(run.seed, "slips"))
    bias = wandering_bias(steps, period_s, run.wheels, stream(run.seed, "bias"))
    return slips + bias + scales_of_the_ground(truth, stream(run.seed, "ground"))


def scans(run: Run) -> Iterator[LaserScan]:
    """The scans of the planar laser that end within the drive."""
    sweep_ns = round(run.laser.sweep_s * SECOND_NS) if run.rough else 0
    return scans_at(run, EPOCH_NS + np.arange(run.scan_delay_ns, run.length_ns - sweep_ns + 1, run.laser.period_ns))


def scans_at(run: Run, stamps: Stamps) -> Iterator[LaserScan]:
    """What the planar laser would scan at `stamps` (n,)."""
    spec = run.laser
    time_increment_s = spec.time_increment_s if run.rough else 0.0
    batches = (stamps[first : first + SCANS_AT_ONCE] for first in range(0, len(stamps), SCANS_AT_ONCE))
    for batch, ranges in _swept(run, batches):
        for stamp_ns, sweep in zip(batch.tolist(), ranges, strict=True):
            angles, limits = (spec.angle_min, spec.angle_increment), (spec.range_min_m, spec.range_max_m)
            yield LaserScan(stamp_ns, "laser", sweep, *angles, *limits, time_increment_s)


def _swept(run: Run, batches: Iterable[Stamps]) -> Iterator[tuple[Stamps, NDArray[np.float32]]]:
    """The stamps and the ranges (n, beams) of each batch of sweeps."""
    noise, uniform = stream(run.seed, "laser"), stream(run.seed, "returns")
    for batch in batches:
        time_s = _seconds(batch)
        if not run.rough:
            yield batch, laser.scans(run.surfaces, _laser_poses(run, time_s), time_s, noise, run.laser)
            continue
        sweep_s, shape = run.laser.sweep_s, (len(batch), run.laser.beams)
        sweeps = laser.Sweeps(time_s, _laser_poses(run, time_s), _laser_poses(run, time_s + sweep_s), sweep_s)
        normal = noise.standard_normal(shape, dtype=np.float32)
        draws = uniform.random((shape[0], returns.DRAWS, shape[1]), dtype=np.float32)
        yield batch, returns.scans(run.surfaces, sweeps, run.laser, normal, draws)


def _laser_poses(run: Run, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    return compose_all(run.drive.poses(time_s), run.T_base_laser.array())


def wifi_scans(run: Run) -> Iterator[WifiScan]:
    """The WiFi scans of all receivers, sorted by stamp."""
    receivers = zip(run.receivers, WIFI_DELAYS_NS, strict=True)
    return heapq.merge(*(_received(run, receiver, delay_ns) for receiver, delay_ns in receivers), key=_stamp_ns)


def _received(run: Run, receiver: radio.SimulatedReceiver, delay_ns: int) -> Iterator[WifiScan]:
    rng = stream(run.seed, receiver.name)
    for stamp_ns in range(EPOCH_NS + delay_ns, EPOCH_NS + run.length_ns + 1, WIFI_PERIOD_NS):
        yield radio.wifi_scan(
            run.environment, receiver, stamp_ns, (stamp_ns - EPOCH_NS) / SECOND_NS, run.drive.poses, rng
        )


def _stamp_ns(measurement: Measurement) -> int:
    return measurement.stamp_ns


def _seconds(stamps_ns: Stamps) -> NDArray[np.float64]:
    """Seconds from the start of the drive."""
    return np.asarray((stamps_ns - EPOCH_NS) / SECOND_NS)
