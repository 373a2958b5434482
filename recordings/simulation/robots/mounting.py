"""Where the laser is on the robot, and which way it looks."""

import math

import numpy as np

from wayfi.backend.pose2 import Pose2

AHEAD_M, ASIDE_M = (-0.2, 0.25), (-0.1, 0.1)
LOOKS_RAD = (0.0, math.pi / 4, -math.pi / 4, math.pi)  # ahead, from a corner of the robot, backwards
CROOKED_RAD = 0.15


def draw_mount(rng: np.random.Generator) -> Pose2:
    """A random T_base_laser: off the middle, and at some angle from one of `LOOKS_RAD`."""
    x, y = rng.uniform(*AHEAD_M), rng.uniform(*ASIDE_M)
    return Pose2(x, y, float(rng.choice(LOOKS_RAD)) + rng.uniform(-CROOKED_RAD, CROOKED_RAD))
