"""Turns on the spot: at each corner of its route the robot stops, turns, and drives on."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import wrap

Floats = NDArray[np.float64]

PEAK_RAD_S = 0.6
MEAN_OVER_PEAK = 2 / 3  # of the turn rate, which rises for a third of the time and falls for another
SAMPLES = 60
COUNTED_M = 1e-3  # of distance that a turn counts for, so that distance tells where in the turn the robot is


@dataclass(frozen=True, slots=True, eq=False)
class TurnedRoute:
    """The poses `path` (k, 3) at the distances `path_m` (k,), and the limit of the speed there, `limit_m_s` (k,)."""

    path_m: Floats
    path: Floats
    limit_m_s: Floats


def with_turns(xy: Floats, corners: NDArray[np.int64]) -> TurnedRoute:
    """The route along `xy` (n, 2), straight at the indices `corners` (c,) but for turns on the spot there."""
    bounds = np.r_[0, corners, len(xy) - 1]
    legs = [xy[first : last + 1] for first, last in pairwise(bounds)]
    parts = [_leg(legs[0], 0.0, 0.0)]
    for leg in legs[1:]:
        turn = _turn(parts[-1], leg)
        parts += [turn, _leg(leg, float(turn.path_m[-1]) + COUNTED_M / SAMPLES, float(turn.path[-1, 2]))]
    return TurnedRoute(
        np.concatenate([part.path_m for part in parts]),
        np.concatenate([part.path for part in parts]),
        np.concatenate([part.limit_m_s for part in parts]),
    )


def _headings(leg: Floats) -> Floats:
    return np.unwrap(np.arctan2(np.gradient(leg[:, 1]), np.gradient(leg[:, 0])))


def _leg(leg: Floats, since_m: float, heading: float) -> TurnedRoute:
    """A leg that begins at the distance `since_m`, its headings unwrapped from `heading` on."""
    theta = _headings(leg)
    theta += 2 * math.pi * round((heading - theta[0]) / (2 * math.pi))
    along = since_m + np.r_[0.0, np.hypot(*np.diff(leg, axis=0).T).cumsum()]
    return TurnedRoute(along, np.column_stack([leg, theta]), np.full(len(leg), np.inf))


def _turn(before: TurnedRoute, leg: Floats) -> TurnedRoute:
    """The turn from the end of `before` to the beginning of `leg`; its samples are evenly spaced in time."""
    x, y, heading = before.path[-1]
    by = wrap(_headings(leg)[0] - heading)
    share = np.arange(1, SAMPLES) / SAMPLES
    theta = heading + by * _turned(share)
    seconds = abs(by) / (MEAN_OVER_PEAK * PEAK_RAD_S)
    along = before.path_m[-1] + COUNTED_M * share
    path = np.column_stack([np.full(len(share), x), np.full(len(share), y), theta])
    return TurnedRoute(along, path, np.full(len(share), COUNTED_M / max(seconds, 0.1)))


def _turned(share: Floats) -> Floats:
    """(n,) how much of a turn is done after `share` (n,) of its time: the turn rate is a trapezoid."""
    thirds = [share < 1 / 3, share < 2 / 3]
    return np.select(thirds, [2.25 * share**2, 1.5 * share - 0.25], 1.0 - 2.25 * (1.0 - share) ** 2)
