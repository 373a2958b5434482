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
NOISE_SIGMAS = 3.0  # of the wheels' noise: what is less may be that
MOST_NATS = 50.0  # of evidence: more is as sure


@dataclass(frozen=True, slots=True)
class WheelStep:
    """A step of the graph, of which the laser denied `denied_m` of the way that the wheels counted.

    `seen`: how much of that the laser knows, from 0 to 1: its share of the information along the way.
    `covariance_scale` multiplies the wheels' covariance, so that they agree with the laser elsewhere.
    """

    number: int
    motion: WheelMotion
    covariance_scale: float = 1.0
    denied_m: float = 0.0
    seen: float = 0.0

    @property
    def speed_m_s(self) -> float:
        """As the wheels have it."""
        return self.motion.path_m / max(self.motion.seconds, SHORTEST_S)


def wheel_step(
    number: int, wheels: WheelFactor, expected: Pose2, match: BetweenFactor | None, covariance_scale: float
) -> WheelStep:
    """The step of factor `number`, which expects the robot at `expected`, with what a scan match says of it."""
    if match is None:
        return WheelStep(number, wheels.motion, covariance_scale)
    along = _along(wheels.motion)
    denied_m = float(along @ (expected.x - match.T_a_b.x, expected.y - match.T_a_b.y))
    of_wheels, of_laser = (float(along @ factor.covariance[:2, :2] @ along) for factor in (wheels, match))
    return WheelStep(number, wheels.motion, covariance_scale, denied_m, of_wheels / (of_wheels + of_laser))


@dataclass(frozen=True, slots=True, eq=False)
class DoubtfulStep:
    """A wheel may have spun in step `number`: so its covariance has (3, 3) `covariance` more."""

    number: int
    covariance: Floats


class _Run:
    """Steps in a row that are faster than usual, each with its excess (m): all of that was counted in vain, or none.

    The laser saw `seen_m` of it, by which all is `nats` likelier than none.
    """

    def __init__(self, faster: list[tuple[WheelStep, float]], config: OdometryConfig) -> None:
        self._faster = faster
        self._whole_m = sum(excess_m for _, excess_m in faster)
        own_m2 = config.sigma_xy_per_sqrt_m**2
        self._own_m2 = [own_m2 * step.covariance_scale * step.motion.path_m for step, _ in faster]
        self._told_m2 = [0.0] * len(faster)
        self.seen_m = sum(step.seen * excess_m for step, excess_m in faster)
        denied_m = sum(step.seen * step.denied_m for step, _ in faster)
        seen_m2 = sum(step.seen * own_m2 for (step, _), own_m2 in zip(faster, self._own_m2, strict=True))
        self.nats = self.seen_m * (denied_m - self.seen_m / 2) / (config.sigma_still_m**2 + seen_m2)

    def doubted(self, share: float) -> list[DoubtfulStep]:
        """The steps with what their variances have to grow by; no less than the wheels' own, which changes nothing.

        A step's variance is the covariance of its excess with all of it; none where all may be the wheels' noise.
        """
        spun, doubtful = _likely(share, self.nats), list[DoubtfulStep]()
        if spun * self._whole_m**2 < NOISE_SIGMAS**2 * sum(self._own_m2):
            return doubtful
        for k, (step, excess_m) in enumerate(self._faster):
            more_m2 = spun * excess_m * self._whole_m - self._told_m2[k]
            if more_m2 > self._own_m2[k]:
                self._told_m2[k] += more_m2
                doubtful.append(DoubtfulStep(step.number, _covariance(step, more_m2)))
        return doubtful


class WheelSpins:
    """Takes the steps of the graph, and gives those that are in doubt once the robot has gone on for some metres."""

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._steps: list[WheelStep] = []
        self._next = 0
        self._faster: list[tuple[WheelStep, float]] = []
        self._excess_m2 = config.spin_doubted_m**2
        self._denied_m2 = config.share_spins * self._excess_m2
        self._runs: list[_Run] = []
        self._told_share = self.share

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
        faster, self._faster = self._faster, []
        return self._doubted(_Run(faster, self._config)) if faster else []

    def _doubted(self, run: _Run) -> list[DoubtfulStep]:
        """What is to be doubted after the newest `run`: it, and all runs before where the share has doubled since."""
        spun = _likely(self.share, run.nats) > 0.5  # as a share, noise that says little of each would add up
        self._excess_m2, self._denied_m2 = self._excess_m2 + run.seen_m**2, self._denied_m2 + spun * run.seen_m**2
        self._runs.append(run)
        if self.share < 2 * self._told_share:
            return run.doubted(self.share)
        self._told_share = self.share
        return [doubtful for earlier in self._runs for doubtful in earlier.doubted(self.share)]

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


def _likely(share: float, nats: float) -> float:
    """The probability of what has the prior `share`, and is by `nats` likelier than not by what was seen."""
    return 1.0 / (1.0 + (1.0 / share - 1.0) * math.exp(-min(max(nats, -MOST_NATS), MOST_NATS)))


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
