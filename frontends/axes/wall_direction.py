"""The direction of most walls that a scan sees, modulo a quarter turn.

Its normals tell which walls these are, and the points where they stand: seen along their direction they fall on few
lines. A row of parked cars, none of which stands straight, is as straight as its building. Projections as sharp as can
be are an old measure of a drawing's skew (Postl, 1986); for scans see Censi, Iocchi and Grisetti, ICRA 2005.
"""

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
_LINE_M = 0.04  # the width of a line on which points fall
_STEPS_RAD = (0.01, 0.001)  # in which directions are tried: at first 12 around the normals' mode, to either side
_TRIED = 12


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


def wall_direction(points: Floats, normals: Floats) -> WallDirection | None:
    """The direction of most walls on which `points` (n, 2) m stand; None where no normal (n, 2; or NaN) is known."""
    known = np.isfinite(normals[:, 0])
    if not known.any():
        return None
    angles = np.arctan2(normals[known, 1], normals[known, 0]) % QUARTER
    mode, near = _mode(angles)
    return WallDirection(_sharpest(points[known], mode) % QUARTER, near / len(angles), near)


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


@njit(cache=True)
def _sharpest(points: Floats, angle: float) -> float:
    """The direction near `angle` along which points (n, 2) fall on the fewest lines, and at right angles to it."""
    reach = math.sqrt((points**2).sum(axis=1).max())
    counts = np.zeros(int(2 * reach / _LINE_M) + 3)
    sharpness = np.zeros(2 * _TRIED + 1)
    for step in _STEPS_RAD:
        for k in range(len(sharpness)):
            tried = angle + (k - _TRIED) * step
            sharpness[k] = _sharpness(points, tried, reach, counts) + _sharpness(points, tried + QUARTER, reach, counts)
        best = min(max(int(np.argmax(sharpness)), 1), len(sharpness) - 2)
        angle += (best - _TRIED) * step
    before, at, after = sharpness[best - 1], sharpness[best], sharpness[best + 1]
    bend = before - 2.0 * at + after
    return angle + (0.5 * step * (before - after) / bend if bend < 0.0 else 0.0)


@njit(cache=True)
def _sharpness(points: Floats, angle: float, reach: float, counts: Floats) -> float:
    """The sum of the counts, to the power of 1.5, of points on lines along `angle`, in `counts`."""
    c, s = math.cos(angle), math.sin(angle)
    counts[:] = 0.0
    for x, y in points:
        line = (c * y - s * x + reach) / _LINE_M
        k = int(line)
        counts[k] += k + 1 - line
        counts[k + 1] += line - k
    return float((counts * np.sqrt(counts)).sum())
