"""Wheel odometry: the integrated true motion with systematic errors, random errors, and errors of single steps."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import between_all, wrap_all
from wayfi.recordings.simulation.robots.models import WheelRanges

Floats = NDArray[np.float64]

SIGMA_DISTANCE_M_PER_SQRT_M = 0.01
SIGMA_TURN_RAD_PER_SQRT_M = math.radians(0.25)
SIGMA_TURN_RAD_PER_SQRT_RAD = math.radians(0.3)

KICKS_PER_M, KICKS_PER_RAD = 0.001, 0.06
KICK_RAD = (0.1, 0.45)
SPINS_PER_M, SPINS_PER_RAD = 0.003, 0.06
SPIN_LENGTH_M = (0.5, 2.0)
SPIN_EXCESS = (0.1, 0.3)


@dataclass(frozen=True, slots=True)
class WheelErrors:
    """The systematic errors: measured distance = scale * true; measured turn = scale * true + biases.

    `bias_walk` is the random walk of the turn bias, rad/s per sqrt(s); `noise` multiplies the random errors.
    """

    distance_scale: float
    turn_scale: float
    bias_rad_per_m: float
    bias_rad_per_s: float
    bias_walk: float = 0.0
    noise: float = 1.0


def draw_wheels(ranges: WheelRanges, rng: np.random.Generator) -> WheelErrors:
    """Systematic errors with random signs, drawn from `ranges`."""
    side = rng.choice([-1.0, 1.0], size=3)
    once = WheelErrors(
        distance_scale=1.0 + side[0] * rng.uniform(*ranges.distance_scale),
        turn_scale=1.0 + side[1] * rng.uniform(*ranges.turn_scale),
        bias_rad_per_m=side[2] * rng.uniform(*ranges.bias_rad_per_m),
        bias_rad_per_s=side[2] * rng.uniform(*ranges.bias_rad_per_s),
        bias_walk=rng.uniform(*ranges.bias_walk),
        noise=rng.uniform(*ranges.noise),
    )
    if rng.random() >= ranges.doubled:
        return once
    return replace(once, turn_scale=2 * once.turn_scale - 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class StepErrors:
    """The errors of each of (n,) steps: an additional turn (rad), and the factors on distance and turn."""

    turn_rad: Floats
    distance_scale: Floats
    turn_scale: Floats

    def __add__(self, other: "StepErrors") -> "StepErrors":
        """Both errors at once."""
        return StepErrors(
            self.turn_rad + other.turn_rad,
            self.distance_scale * other.distance_scale,
            self.turn_scale * other.turn_scale,
        )


def no_slips(steps: int) -> StepErrors:
    """No error in any step."""
    return StepErrors(np.zeros(steps), np.ones(steps), np.ones(steps))


def draw_slips(truth: Floats, rng: np.random.Generator) -> StepErrors:
    """Random slip along the true poses `truth` (n + 1, 3): rare, and more frequent in turns.

    Sideways slip makes the heading jump by `KICK_RAD` in one step. Wheel spin makes the measured distance too long by
    the share `SPIN_EXCESS`, over `SPIN_LENGTH_M`.
    """
    distance, turn = _motion(truth)
    draws = rng.random((len(turn), 6))
    kicks = draws[:, 0] < KICKS_PER_M * distance + KICKS_PER_RAD * np.abs(turn)
    side = np.where(draws[:, 1] < 0.5, -1.0, 1.0)
    spins = draws[:, 3] < SPINS_PER_M * distance + SPINS_PER_RAD * np.abs(turn)
    scale, along = np.ones(len(turn)), distance.cumsum()
    for step in np.flatnonzero(spins):
        until = along[step] + _interpolated(SPIN_LENGTH_M, draws[step, 4])
        scale[step : np.searchsorted(along, until)] = 1.0 + _interpolated(SPIN_EXCESS, draws[step, 5])
    kicked = np.where(kicks, side * _interpolated(KICK_RAD, draws[:, 2]), 0.0)
    return StepErrors(kicked, scale, np.ones(len(turn)))


def odometry(
    truth: Floats, period_s: float, wheels: WheelErrors, steps: StepErrors, rng: np.random.Generator
) -> Floats:
    """(n, 3) T_odom_base of the odometry for the true poses `truth` (n, 3), `period_s` apart; starts at 0."""
    distance, turn = _motion(truth)
    noise = wheels.noise * rng.standard_normal((len(turn), 2))
    sigma_turn = np.sqrt(SIGMA_TURN_RAD_PER_SQRT_M**2 * distance + SIGMA_TURN_RAD_PER_SQRT_RAD**2 * np.abs(turn))
    measured = wheels.distance_scale * distance + noise[:, 0] * SIGMA_DISTANCE_M_PER_SQRT_M * np.sqrt(distance)
    turned = (
        wheels.turn_scale * steps.turn_scale * turn
        + wheels.bias_rad_per_m * distance
        + wheels.bias_rad_per_s * period_s
    )
    turned = turned + noise[:, 1] * sigma_turn
    return _integrated(measured * steps.distance_scale, turned + steps.turn_rad)


def _motion(truth: Floats) -> tuple[Floats, Floats]:
    """The distances (n,) m and turns (n,) rad between the poses `truth` (n + 1, 3)."""
    motion = between_all(truth[:-1], truth[1:])
    return np.hypot(motion[:, 0], motion[:, 1]), motion[:, 2]


def _interpolated(limits: tuple[float, float], share: Floats) -> Floats:
    return limits[0] + share * (limits[1] - limits[0])


def _integrated(distance: Floats, turn: Floats) -> Floats:
    """(n + 1, 3) poses after steps of `distance` (n,) along arcs of `turn` (n,) rad."""
    theta = np.r_[0.0, turn.cumsum()]
    middle = theta[:-1] + turn / 2
    x = np.r_[0.0, (distance * np.cos(middle)).cumsum()]
    y = np.r_[0.0, (distance * np.sin(middle)).cumsum()]
    return np.column_stack([x, y, wrap_all(theta)])
