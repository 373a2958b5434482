"""The direction of most walls that a scan sees, from its normals, modulo a quarter turn."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from wayfi.backend.pose2 import Floats

QUARTER = math.pi / 2
_BINS = 90  # of a degree: a normal errs by one to three
_PEAK = (1.0, 2.0, 3.0, 2.0, 1.0)  # the weights of neighbouring bins
_NEAR_RAD = 0.03  # what is further off the mode has no part in the mean
_ALONG_RAD = 0.05  # what is further off stands along no axis
_ROUNDS = 6  # of the mean around the mode, which moves by less than 0.1 mrad in the last


class WallDirection(NamedTuple):
    """Walls stand at `angle` rad, in [0, pi/2), in base_link, or at right angles to it.

    These are `share` of the scan's normals, and `points` in number.
    """

    angle: float
    share: float
    points: int


def quarter(angle: float) -> float:
    """The angle (rad) modulo a quarter turn, in [-pi/4, pi/4)."""
    return (angle + QUARTER / 2) % QUARTER - QUARTER / 2


def wall_direction(normals: Floats) -> WallDirection | None:
    """The mode of the `normals` (n, 2; NaN where unknown) modulo a quarter turn; None where none is known."""
    known = normals[np.isfinite(normals[:, 0])]
    if not len(known):
        return None
    angles = np.arctan2(known[:, 1], known[:, 0]) % QUARTER
    mode, near = _mode(angles)
    return WallDirection(mode, near / len(angles), near)


@njit(cache=True)
def _mode(angles: Floats) -> tuple[float, int]:
    """The mode of angles (n,) in [0, pi/2), by a mean shift from their histogram's peak, and how many are near it."""
    counts = np.zeros(_BINS)
    for angle in angles:
        counts[min(int(angle * _BINS / QUARTER), _BINS - 1)] += 1.0
    peaks = np.zeros(_BINS)
    for k in range(_BINS):
        for i, weight in enumerate(_PEAK):
            peaks[k] += weight * counts[(k + i - 2) % _BINS]
    mode = (np.argmax(peaks) + 0.5) * QUARTER / _BINS
    for _ in range(_ROUNDS):
        off = (angles - mode + QUARTER / 2) % QUARTER - QUARTER / 2
        weights = np.maximum(1.0 - (off / _NEAR_RAD) ** 2, 0.0) ** 2
        if weights.sum() > 0.0:
            mode += (weights * off).sum() / weights.sum()
    off = (angles - mode + QUARTER / 2) % QUARTER - QUARTER / 2
    return mode % QUARTER, int((np.abs(off) < _ALONG_RAD).sum())
