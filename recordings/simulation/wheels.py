"""Wheel odometry: the true motion with systematic and random errors, added up; and wheels that slip."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import between_all, wrap_all

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
    """The systematic errors: measured distance = scale * true; measured turn = scale * true + biases."""

    distance_scale: float
    turn_scale: float
    bias_rad_per_m: float
    bias_rad_per_s: float


def draw_wheels(rng: np.random.Generator) -> WheelErrors:
    """Wheels whose errors have random signs and sizes in a band, so that every drive ends about equally far off."""
    side = rng.choice([-1.0, 1.0], size=3)
    return WheelErrors(
        distance_scale=1.0 + side[0] * rng.uniform(0.005, 0.012),
        turn_scale=1.0 + side[1] * rng.uniform(0.003, 0.006),
        bias_rad_per_m=side[2] * math.radians(rng.uniform(0.12, 0.16)),
        bias_rad_per_s=side[2] * math.radians(rng.uniform(0.001, 0.003)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Slips:
    """For each of (n,) steps: the rad that the heading jumps by, and how many times too long the distance is."""

    turn_rad: Floats
    distance_scale: Floats


def no_slips(steps: int) -> Slips:
    """Wheels that hold."""
    return Slips(np.zeros(steps), np.ones(steps))


def draw_slips(truth: Floats, rng: np.random.Generator) -> Slips:
    """Where the wheels slip on the way through the true poses `truth` (n + 1, 3): rarely, and rather in turns.

    Either they slip sideways, and the heading jumps by `KICK_RAD` in a step, or they spin, and over `SPIN_LENGTH_M`
    the distance comes out too long by `SPIN_EXCESS` of itself.
    """
    distance, turn = _motion(truth)
    luck = rng.random((len(turn), 6))
    kicks = luck[:, 0] < KICKS_PER_M * distance + KICKS_PER_RAD * np.abs(turn)
    side = np.where(luck[:, 1] < 0.5, -1.0, 1.0)
    spins = luck[:, 3] < SPINS_PER_M * distance + SPINS_PER_RAD * np.abs(turn)
    scale, along = np.ones(len(turn)), distance.cumsum()
    for step in np.flatnonzero(spins):
        until = along[step] + _between(SPIN_LENGTH_M, luck[step, 4])
        scale[step : np.searchsorted(along, until)] = 1.0 + _between(SPIN_EXCESS, luck[step, 5])
    return Slips(np.where(kicks, side * _between(KICK_RAD, luck[:, 2]), 0.0), scale)


def odometry(truth: Floats, period_s: float, wheels: WheelErrors, slips: Slips, rng: np.random.Generator) -> Floats:
    """(n, 3) T_odom_base that `wheels` report for the true poses `truth` (n, 3), `period_s` apart; starts at 0."""
    distance, turn = _motion(truth)
    noise = rng.standard_normal((len(turn), 2))
    sigma_turn = np.sqrt(SIGMA_TURN_RAD_PER_SQRT_M**2 * distance + SIGMA_TURN_RAD_PER_SQRT_RAD**2 * np.abs(turn))
    measured = wheels.distance_scale * distance + noise[:, 0] * SIGMA_DISTANCE_M_PER_SQRT_M * np.sqrt(distance)
    turned = wheels.turn_scale * turn + wheels.bias_rad_per_m * distance + wheels.bias_rad_per_s * period_s
    turned = turned + noise[:, 1] * sigma_turn
    return _added_up(measured * slips.distance_scale, turned + slips.turn_rad)


def _motion(truth: Floats) -> tuple[Floats, Floats]:
    """(n,) m and (n,) rad of the steps between poses `truth` (n + 1, 3)."""
    motion = between_all(truth[:-1], truth[1:])
    return np.hypot(motion[:, 0], motion[:, 1]), motion[:, 2]


def _between(limits: tuple[float, float], share: Floats) -> Floats:
    return limits[0] + share * (limits[1] - limits[0])


def _added_up(distance: Floats, turn: Floats) -> Floats:
    """(n + 1, 3) poses after each step of `distance` (n,) along an arc of `turn` (n,) rad."""
    theta = np.r_[0.0, turn.cumsum()]
    middle = theta[:-1] + turn / 2
    x = np.r_[0.0, (distance * np.cos(middle)).cumsum()]
    y = np.r_[0.0, (distance * np.sin(middle)).cumsum()]
    return np.column_stack([x, y, wrap_all(theta)])
