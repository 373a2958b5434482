"""Wheel odometry: the true motion with systematic and random errors, added up."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import between_all, wrap_all

Floats = NDArray[np.float64]

SIGMA_DISTANCE_M_PER_SQRT_M = 0.01
SIGMA_TURN_RAD_PER_SQRT_M = math.radians(0.25)
SIGMA_TURN_RAD_PER_SQRT_RAD = math.radians(0.3)


@dataclass(frozen=True, slots=True)
class Wheels:
    """The systematic errors: measured distance = scale * true; measured turn = scale * true + biases."""

    distance_scale: float
    turn_scale: float
    bias_rad_per_m: float
    bias_rad_per_s: float


def draw_wheels(rng: np.random.Generator) -> Wheels:
    """Wheels whose errors have random signs and sizes in a band, so that every drive ends about equally far off."""
    side = rng.choice([-1.0, 1.0], size=3)
    return Wheels(
        distance_scale=1.0 + side[0] * rng.uniform(0.005, 0.012),
        turn_scale=1.0 + side[1] * rng.uniform(0.003, 0.006),
        bias_rad_per_m=side[2] * math.radians(rng.uniform(0.12, 0.16)),
        bias_rad_per_s=side[2] * math.radians(rng.uniform(0.001, 0.003)),
    )


def odometry(truth: Floats, period_s: float, wheels: Wheels, rng: np.random.Generator) -> Floats:
    """(n, 3) T_odom_base that `wheels` report for the true poses `truth` (n, 3), `period_s` apart; starts at 0."""
    motion = between_all(truth[:-1], truth[1:])
    distance = np.hypot(motion[:, 0], motion[:, 1])
    turn = motion[:, 2]
    noise = rng.standard_normal((len(motion), 2))
    sigma_turn = np.sqrt(SIGMA_TURN_RAD_PER_SQRT_M**2 * distance + SIGMA_TURN_RAD_PER_SQRT_RAD**2 * np.abs(turn))
    measured = wheels.distance_scale * distance + noise[:, 0] * SIGMA_DISTANCE_M_PER_SQRT_M * np.sqrt(distance)
    turned = wheels.turn_scale * turn + wheels.bias_rad_per_m * distance + wheels.bias_rad_per_s * period_s
    return _added_up(measured, turned + noise[:, 1] * sigma_turn)


def _added_up(distance: Floats, turn: Floats) -> Floats:
    """(n + 1, 3) poses after each step of `distance` (n,) along an arc of `turn` (n,) rad."""
    theta = np.r_[0.0, turn.cumsum()]
    middle = theta[:-1] + turn / 2
    x = np.r_[0.0, (distance * np.cos(middle)).cumsum()]
    y = np.r_[0.0, (distance * np.sin(middle)).cumsum()]
    return np.column_stack([x, y, wrap_all(theta)])
