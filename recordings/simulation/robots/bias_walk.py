"""The turn bias of a robot that warms up: a random walk."""

import numpy as np

from wayfi.recordings.simulation.wheels import StepErrors, WheelErrors, no_slips


def wandering_bias(steps: int, period_s: float, wheels: WheelErrors, rng: np.random.Generator) -> StepErrors:
    """What the walk of the turn bias, from 0 on, adds to the turn in each of `steps` steps of `period_s`."""
    rate = wheels.bias_walk * np.sqrt(period_s) * rng.standard_normal(steps).cumsum()
    still = no_slips(steps)
    return StepErrors(rate * period_s, still.distance_scale, still.turn_scale)
