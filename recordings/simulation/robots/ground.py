"""The floor under the wheels: carpet and concrete have scales of their own, the same at every visit."""

import numpy as np
from numpy.typing import NDArray

from wayfi.recordings.simulation.roughness import draw_field
from wayfi.recordings.simulation.wheels import StepErrors

Floats = NDArray[np.float64]

DISTANCE_RMS, TURN_RMS = 0.005, 0.01
PATCH_LENGTHS_M = (8.0, 60.0)


def scales_of_the_ground(truth: Floats, rng: np.random.Generator) -> StepErrors:
    """The factors of the ground on the distance and the turn of each step along `truth` (n + 1, 3)."""
    distance, turn = (draw_field(rms, PATCH_LENGTHS_M, rng) for rms in (DISTANCE_RMS, TURN_RMS))
    xy = truth[:-1, :2]
    return StepErrors(np.zeros(len(xy)), 1.0 + distance(xy), 1.0 + turn(xy))
