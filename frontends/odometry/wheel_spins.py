"""Finds steps in which a drive wheel may have spun, so that the wheels counted more way than there was.

A wheel that loses its grip turns faster for a while, and the robot does not. A robot that speeds up for a while looks
the same to its wheels; a laser that sees its way tells which of both it was. Where walls leave the way along them open,
as in a smooth aisle, the drive so far tells how likely it is: by the share of such excess that the laser has denied. So
a robot that changes its speed is believed, and one that never does is not, once its wheels were seen to spin.

The excess is the wheels' way beyond what the usual speed before and after leads to. That is the median over the path
and not the time, for stops to count nothing; a start or a stop is no excess, since one side of it is as fast.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.graph.factors import BetweenFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.odometry.odometry_config import OdometryConfig

SHORTEST_S = 1e-3  # of a step
MOST_NATS = 50.0  # of evidence: more is as sure


@dataclass(frozen=True, slots=True)
class WheelStep:
    """A step of the graph, of which the laser denied `denied_m` of the way that the wheels counted.

    `seen`: how much of that the laser knows, from 0 to 1: its share of the information along the way.
    """

    number: int
    motion: WheelMotion
    denied_m: float = 0.0
    seen: float = 0.0

    @property
    def speed_m_s(self) -> float:
        """As the wheels have it."""
        return self.motion.path_m / max(self.motion.seconds, SHORTEST_S)


def wheel_step(number: int, wheels: WheelFactor, expected: Pose2, match: BetweenFactor | None) -> WheelStep:
    """The step of factor `number`, which expects the robot at `expected`, with what a scan match says of it."""
    if match is None:
        return WheelStep(number, wheels.motion)
    along = _along(wheels.motion)
    denied_m = float(along @ (expected.x - match.T_a_b.x, expected.y - match.T_a_b.y))
    of_wheels, of_laser = (float(along @ factor.covariance[:2, :2] @ along) for factor in (wheels, match))
    return WheelStep(number, wheels.motion, denied_m, of_wheels / (of_wheels + of_laser))


@dataclass(frozen=True, slots=True, eq=False)
class DoubtfulStep:
    """A wheel may have spun in step `number`: so its covariance has (3, 3) `covariance` more."""

    number: int
    covariance: Floats


class WheelSpins:
    """Takes the steps of the graph, and gives those that are in doubt once the robot has gone on for some metres."""

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._steps: list[WheelStep] = []
        self._next = 0
        self._faster: list[tuple[WheelStep, float]] = []
        self._excess_m2 = config.spin_doubted_m**2
        self._denied_m2 = config.share_spins * self._excess_m2

    @property
    def share(self) -> float:
        """The share of the excess so far that the laser has denied, of its squares: large ones tell most."""
        return self._denied_m2 / self._excess_m2

    def add(self, step: WheelStep) -> list[DoubtfulStep]:
        """Add the next step; returns earlier ones, each once."""
        self._steps.append(step)
        doubtful: list[DoubtfulStep] = []
        while _path_m(self._steps[self._next + 1 :]) >= self._config.spin_around_m:
            doubtful += self._decide(self._steps[self._next])
            self._next += 1
            self._forget()
        return doubtful

    def _decide(self, step: WheelStep) -> list[DoubtfulStep]:
        """Add `step` to the run of faster ones; or, if it ends one, what is to be doubted of that."""
        before, after = self._steps[: self._next], self._steps[self._next + 1 :]
        if _path_m(before) < self._config.spin_around_m:
            return []
        usual_m_s = max(_usual_speed(before), _usual_speed(after))
        excess_m = step.motion.path_m - usual_m_s * step.motion.seconds
        if excess_m > 0.0:
            self._faster.append((step, excess_m))
            return []
        run, self._faster = self._faster, []
        return self._doubted(run) if run else []

    def _doubted(self, run: list[tuple[WheelStep, float]]) -> list[DoubtfulStep]:
        """The steps of a `run` with their variances, after learning from it.

        All its excess was counted in vain, or none: so a step's variance is the covariance of its own with all of it.
        Where that is less than the wheels' own, it changes nothing.
        """
        spun, whole_m = self._learn(run), sum(excess_m for _, excess_m in run)
        variances = [(step, spun * excess_m * whole_m) for step, excess_m in run]
        return [
            DoubtfulStep(step.number, _covariance(step, variance))
            for step, variance in variances
            if variance > self._own_variance(step)
        ]

    def _learn(self, run: list[tuple[WheelStep, float]]) -> float:
        """How likely the wheels spun in a `run`: by the drive so far, and by what the laser denies of it."""
        seen_m = sum(step.seen * excess_m for step, excess_m in run)
        denied_m = sum(step.seen * step.denied_m for step, _ in run)
        noise_m2 = self._config.sigma_still_m**2 + sum(step.seen * self._own_variance(step) for step, _ in run)
        nats = seen_m * (2 * denied_m - seen_m) / (2 * noise_m2)  # by which all of the excess is likelier than none
        spun = 1.0 / (1.0 + (1.0 / self.share - 1.0) * math.exp(-min(max(nats, -MOST_NATS), MOST_NATS)))
        self._excess_m2, self._denied_m2 = self._excess_m2 + seen_m**2, self._denied_m2 + spun * seen_m**2
        return spun

    def _own_variance(self, step: WheelStep) -> float:
        """The variance (m^2) that the wheels' way has without any spin."""
        return self._config.sigma_xy_per_sqrt_m**2 * step.motion.path_m

    def _forget(self) -> None:
        """Drop the oldest steps that are not needed any more."""
        while _path_m(self._steps[1 : self._next]) >= self._config.spin_around_m:
            self._steps.pop(0)
            self._next -= 1


def doubt_spun(graph: PoseGraph, steps: Iterable[DoubtfulStep]) -> None:
    """With the next update of the graph, let the wheels of `steps` be less sure."""
    for step in steps:
        wheels = graph.factors()[step.number]
        assert isinstance(wheels, WheelFactor)
        graph.substitute(step.number, replace(wheels, covariance=wheels.covariance + step.covariance))


def _path_m(steps: Sequence[WheelStep]) -> float:
    return sum(step.motion.path_m for step in steps)


def _usual_speed(steps: Sequence[WheelStep]) -> float:
    """The speed (m/s) below which half of the path of `steps` was driven."""
    ordered = sorted(steps, key=lambda step: step.speed_m_s)
    path_m = np.cumsum([step.motion.path_m for step in ordered])
    return ordered[int(np.searchsorted(path_m, path_m[-1] / 2))].speed_m_s


def _along(motion: WheelMotion) -> Floats:
    """(2,) the direction of a motion; x where there is none."""
    bearing = math.atan2(motion.pose.y, motion.pose.x)
    return np.array([math.cos(bearing), math.sin(bearing)])


def _covariance(step: WheelStep, variance_m2: float) -> Floats:
    along = np.append(_along(step.motion), 0.0)
    return variance_m2 * np.outer(along, along)
