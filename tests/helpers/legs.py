"""Short drives in a hall, leg by leg, whose wheels may say something else than the robot does; fed to a pipeline."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from rooms import HALL

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import Event, KeyframeAdded, PosePublished, StateChanged
from wayfi.frontends.measurements import LaserScan, Measurement, Odometry
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.result import DriveEstimate
from wayfi.recordings.simulation import laser
from wayfi.recordings.simulation.laser import LaserSpec
from wayfi.recordings.simulation.surfaces import Surfaces, box, still
from wayfi.service.config import load_config

TICK_S, TICKS_A_SCAN = 0.05, 4
SPEED_M_S, TURN_RAD_S = 0.5, 0.6
SPEC = LaserSpec(360, -math.pi, math.radians(1.0), 0.06, 12.0, 200_000_000, turn_s=0.0, reach_m=60.0)
ROOM = np.concatenate([box(20.0, 0.0, 24.0, 7.0), box(21.0, 1.0, 22.0, 1.5)])
WALLS = np.concatenate([HALL, ROOM])
START = Pose2(-4.5, -2.5, 0.0)


@dataclass(frozen=True)
class Leg:
    """A drive of `metres` ahead, a turn of `turn` rad on the spot, or `wait_s`.

    The wheels say `wheels` times that, or `said` at each tick. At its beginning the robot is `put` elsewhere, or the
    odometry leaps by `leap`. While it is `silent` nothing is sent.
    """

    metres: float = 0.0
    turn: float = 0.0
    wait_s: float = 0.0
    wheels: float = 1.0
    said: Pose2 | None = None
    put: Pose2 | None = None
    leap: Pose2 | None = None
    silent: bool = False

    def steps(self) -> list[Pose2]:
        """The true motion of each tick."""
        seconds = self.wait_s + abs(self.metres) / SPEED_M_S + abs(self.turn) / TURN_RAD_S
        n = math.ceil(seconds / TICK_S - 1e-9)
        return [Pose2(self.metres / n, 0.0, self.turn / n)] * n

    def told(self, step: Pose2, rng: np.random.Generator) -> Pose2:
        """What the wheels say of a true motion."""
        if self.said is not None:
            return self.said
        length, turn = self.wheels * step.x, self.wheels * step.theta
        noise = rng.standard_normal(2) * (0.01 * math.sqrt(abs(length)), 0.005 * math.sqrt(abs(turn) + abs(length)))
        return Pose2(length + noise[0], 0.0, turn + noise[1])


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """What came of a drive; errors are in the frame of the first pose."""

    events: list[Event]
    truth: dict[int, Pose2]
    legs_ns: list[int]
    estimate: DriveEstimate

    @property
    def states(self) -> list[tuple[float, str, str]]:
        """Each change of state: the second, the state and the reason."""
        return [(e.stamp_ns * 1e-9, e.state.value, e.reason) for e in self.events if isinstance(e, StateChanged)]

    def keyframes_between(self, first_s: float, last_s: float) -> int:
        """How many keyframes there are in this time."""
        return sum(isinstance(e, KeyframeAdded) and first_s < e.stamp_ns * 1e-9 < last_s for e in self.events)

    def published(self) -> list[PosePublished]:
        """The poses as they were published."""
        return [e for e in self.events if isinstance(e, PosePublished)]

    def error(self, pose: PosePublished) -> Floats:
        """(3,) of a published pose, in `map`."""
        true = START.between(self.truth[pose.stamp_ns])
        T = pose.T_map_base
        return np.array([T.x - true.x, T.y - true.y, true.between(T).theta])

    def worst_m(self, first_s: float = 0.0) -> float:
        """How far (m) a published pose is off at worst from a second on."""
        late = [self.error(p) for p in self.published() if p.stamp_ns * 1e-9 >= first_s]
        return max(math.hypot(e[0], e[1]) for e in late)

    def worst_along_m(self) -> float:
        """How far (m) a pose of the whole drive is off at worst along x, as estimated at its end."""
        stamps_ns, final = self.estimate.stamps_ns.tolist(), self.estimate.final
        true = np.array([START.between(self.truth[stamp_ns]).x for stamp_ns in stamps_ns])
        return float(np.abs(final[:, 0] - true).max())

    def start_s(self, leg: int) -> float:
        """When a leg began."""
        return self.legs_ns[leg] * 1e-9


def follow(legs: Sequence[Leg], surfaces: Surfaces | None = None, seed: int = 0) -> Driven:
    """Drive the legs from START, all in one pipeline."""
    pipeline, events, truth, begun = Pipeline(load_config()), [], {}, []
    for pose, measurement in _measured(legs, surfaces or still(WALLS), np.random.default_rng(seed), begun):
        truth[measurement.stamp_ns] = pose
        events += pipeline.process(measurement)
    estimate, last = pipeline.finish()
    return Driven(events + last, truth, begun, estimate)


def _measured(
    legs: Sequence[Leg], surfaces: Surfaces, rng: np.random.Generator, begun: list[int]
) -> Iterator[tuple[Pose2, Measurement]]:
    """Each measurement and the true pose at its stamp; notes when the legs began in `begun`."""
    pose, told, tick = START, Pose2(), 0
    for leg in legs:
        begun.append(round(tick * TICK_S * 1e9))
        pose, told = leg.put or pose, told @ (leg.leap or Pose2())
        for step in leg.steps():
            pose, told, tick = pose @ step, told @ leg.told(step, rng), tick + 1
            stamp_ns = round(tick * TICK_S * 1e9)
            if leg.silent:
                continue
            yield pose, Odometry(stamp_ns, told)
            if tick % TICKS_A_SCAN == 0:
                ranges = laser.scans(surfaces, pose.array()[None], np.array([tick * TICK_S]), rng, SPEC)[0]
                yield (
                    pose,
                    LaserScan(stamp_ns, "base_link", ranges, SPEC.angle_min, SPEC.angle_increment, 0.06, 12.0, 0.0),
                )
