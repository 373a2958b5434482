"""A robot that drives through a storey: what it measures, and where it was."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from buildings.storey import Storey
from drives import Arrival, Simulated

from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.measurements import LaserScan, Measurement, Odometry, StaticTransforms, Transform
from wayfi.recordings.simulation import laser, radio, wheels
from wayfi.recordings.simulation.laser import LaserSpec
from wayfi.recordings.simulation.run import EPOCH_NS
from wayfi.recordings.trajectory import Trajectory

TICK_S, TICKS_A_SCAN, TICKS_A_WIFI_SCAN = 0.1, 2, 10
SPEED_M_S, TURN_RAD_S = 0.6, 0.8
SPEC = LaserSpec(541, -math.radians(135), math.radians(0.5), 0.06, 12.0, 200_000_000, turn_s=0.0, reach_m=60.0)
WHEELS = wheels.WheelErrors(1.012, 0.98, 0.01, 0.0)
MOUNT = Pose2(0.2, 0.0, 0.0)
DAY_NS = 86_400 * 1_000_000_000
Route = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Robot:
    """Where its laser is (None: it has none), and whether it hears WiFi."""

    mount: Pose2 | None = MOUNT
    wifi: bool = True


ROBOT = Robot()


def drive(
    place: Storey, route: Sequence[tuple[float, float]], day: int, robot: Robot = ROBOT, wait_s: float = 0.0
) -> Simulated:
    """A drive along `route`, after a wait at its start, on a day that decides all noise."""
    poses = _poses(route, wait_s)
    time_s = TICK_S * np.arange(len(poses))
    stamps = EPOCH_NS + day * DAY_NS + np.round(1e9 * time_s).astype(np.int64)
    measured = [*_odometry(poses, stamps, day), *_scans(place, poses, time_s, stamps, robot, day)]
    measured += _wifi(place, poses, time_s, stamps, day) if robot.wifi else []
    first = [_static(robot.mount, int(stamps[0]))] if robot.mount else []
    ordered = first + sorted(measured, key=lambda m: m.stamp_ns)
    return Simulated(tuple(Arrival(m.stamp_ns, m) for m in ordered), Trajectory(stamps, poses))


def _poses(route: Route, wait_s: float) -> Floats:
    """(n, 3) true poses, `TICK_S` apart: straight from corner to corner, turning on the spot."""
    headings = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(route)]
    poses = [np.tile((*route[0], headings[0]), (round(wait_s / TICK_S) + 1, 1))]
    for number, (a, b) in enumerate(pairwise(route)):
        before, theta = poses[-1][-1][2], headings[number]
        turn = (theta - before + math.pi) % (2 * math.pi) - math.pi
        turning = max(1, math.ceil(abs(turn) / TURN_RAD_S / TICK_S))
        share = np.arange(1, turning + 1) / turning
        poses.append(np.column_stack([np.tile(a, (turning, 1)), before + share * turn]))
        going = max(1, math.ceil(math.dist(a, b) / SPEED_M_S / TICK_S))
        share = np.arange(1, going + 1)[:, None] / going
        poses.append(
            np.column_stack([np.array(a) + share * (np.array(b) - np.array(a)), np.full(going, before + turn)])
        )
    return np.concatenate(poses)


def _odometry(poses: Floats, stamps: Sequence[int], day: int) -> Iterator[Measurement]:
    said = wheels.odometry(poses, TICK_S, WHEELS, wheels.no_slips(len(poses) - 1), np.random.default_rng(100 + day))
    for stamp_ns, pose in zip(np.asarray(stamps).tolist(), said, strict=True):
        yield Odometry(stamp_ns, Pose2.of(pose))


def _scans(
    place: Storey, poses: Floats, time_s: Floats, stamps: Sequence[int], robot: Robot, day: int
) -> Iterator[Measurement]:
    if robot.mount is None:
        return
    chosen = np.arange(0, len(poses), TICKS_A_SCAN)
    at = compose_all(poses[chosen], robot.mount.array())
    seen = laser.scans(place.surfaces(), at, time_s[chosen], np.random.default_rng(200 + day), SPEC)
    limits = SPEC.range_min_m, SPEC.range_max_m
    for stamp_ns, sweep in zip(np.asarray(stamps)[chosen].tolist(), seen, strict=True):
        yield LaserScan(stamp_ns, "laser", sweep, SPEC.angle_min, SPEC.angle_increment, *limits)


def _wifi(place: Storey, poses: Floats, time_s: Floats, stamps: Sequence[int], day: int) -> Iterator[Measurement]:
    assert place.radio is not None
    receiver, rng = radio.SimulatedReceiver("phone", 1.5), np.random.default_rng(300 + day)
    for k in range(TICKS_A_WIFI_SCAN, len(poses), TICKS_A_WIFI_SCAN):
        yield radio.wifi_scan(place.radio, receiver, int(stamps[k]), float(time_s[k]), _along(poses, time_s), rng)


def _along(poses: Floats, time_s: Floats):  # noqa: ANN202 - a function of times
    return lambda at_s: np.column_stack([np.interp(at_s, time_s, poses[:, k]) for k in range(3)])


def _static(mount: Pose2, stamp_ns: int) -> StaticTransforms:
    half = math.sin(mount.theta / 2), math.cos(mount.theta / 2)
    return StaticTransforms(stamp_ns, (Transform("base_link", "laser", (mount.x, mount.y, 0.2), (0.0, 0.0, *half)),))
