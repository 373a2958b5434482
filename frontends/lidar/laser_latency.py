"""Estimates the latency of the laser's driver: how late it stamps its scans, a tenth of a second on many robots.

At the right offset the turns by scan matching follow those of the wheels most closely. The wheels' turn scale and bias
are fitted at each offset, so that they do not hide it, and the residuals are taken to be Laplace's, which a few failed
matches do not spoil.
"""

import math
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.lidar.lidar_config import LatencyConfig

REWEIGHTINGS = 5  # of the least squares: the residuals change by less than a tenth of a per cent after three
LEAST_RESIDUAL_RAD = 1e-3  # what scan matching leaves at best


@dataclass(frozen=True, slots=True, eq=False)
class Turn:
    """A turn (rad) by the laser, and (k,) by the wheels at each offset of the laser's stamps; the path meanwhile."""

    by_laser: float
    by_wheels: Floats
    path_m: float


def latency_s(turns: list[Turn], offsets_s: Floats, config: LatencyConfig) -> float | None:
    """What is to be added to the laser's stamps, s; None while no latency is significant.

    `offsets_s` (k,) are those of the turns, evenly spaced.
    """
    if len(turns) < config.min_turns:
        return None
    step_s = offsets_s[1] - offsets_s[0]
    small = np.flatnonzero(np.abs(offsets_s) < config.max_s + step_s).tolist()
    errors_rad = np.array([_mean_error_rad(turns, offset) for offset in small])
    best, none = int(errors_rad.argmin()), len(small) // 2
    gain = len(turns) * math.log(errors_rad[none] / errors_rad[best])
    if best in (0, len(small) - 1) or gain < config.min_gain:
        return None
    latency = float(offsets_s[small[best]] + vertex(*errors_rad[best - 1 : best + 2] ** 2) * step_s)
    return latency if config.min_s <= abs(latency) <= config.max_s else None


def vertex(before: float, lowest: float, after: float) -> float:
    """Where the parabola through three values has its vertex, in steps from the middle one, which is the lowest."""
    return 0.5 * (before - after) / (before - 2 * lowest + after)


def _mean_error_rad(turns: list[Turn], offset: int) -> float:
    """The mean absolute residual of the turns by the laser, fitted by the wheels' turns and paths at an offset."""
    laser = np.array([turn.by_laser for turn in turns])
    wheels = np.array([[turn.by_wheels[offset], turn.path_m] for turn in turns])
    weights = np.ones(len(turns))
    for _ in range(REWEIGHTINGS):
        scaled = wheels * weights[:, None]
        fitted = np.linalg.lstsq(scaled, laser * weights, rcond=None)[0]
        errors = np.abs(laser - wheels @ fitted)
        weights = 1.0 / np.sqrt(np.maximum(errors, LEAST_RESIDUAL_RAD))
    return float(np.mean(np.maximum(errors, LEAST_RESIDUAL_RAD)))
