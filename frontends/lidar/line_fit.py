"""The line through points of the plane, by total least squares, from running sums over them."""

from typing import NamedTuple

import numpy as np
from numba import njit

# Variance across a line over variance along it, at most: with less than 3 times the spread along than across, the
# direction of a fit is mostly noise. Neighbours within 0.2 m (sigma 0.12 m) then keep their line up to 4 cm of noise.
MAX_THICKNESS_RATIO = 0.1
MIN_VARIANCE_M2 = 1e-8  # (0.1 mm)^2, below any range's resolution: the points coincide and have no direction


class PointSums(NamedTuple):
    """The number `n` of points, the sums of their coordinates (m) and of the products of these (m^2)."""

    n: int
    x: float
    y: float
    xx: float
    xy: float
    yy: float


NO_POINTS = PointSums(0, 0.0, 0.0, 0.0, 0.0, 0.0)


@njit(cache=True)
def add_point(sums: PointSums, x: float, y: float) -> PointSums:
    """The sums with one more point (x, y) m."""
    return PointSums(
        sums.n + 1, sums.x + x, sums.y + y, sums.xx + x * x, sums.xy + x * y, sums.yy + y * y
    )  # fmt: skip


@njit(cache=True)
def fit_line(sums: PointSums) -> tuple[float, float, float, float, float]:
    """Centroid x, y (m), unit normal x, y and variance across the line (m^2) of at least one point.

    The normal is NaN where the points form no line: see MAX_THICKNESS_RATIO and MIN_VARIANCE_M2.
    """
    mx, my = sums.x / sums.n, sums.y / sums.n
    vxx, vxy, vyy = sums.xx / sums.n - mx * mx, sums.xy / sums.n - mx * my, sums.yy / sums.n - my * my
    mean, spread = 0.5 * (vxx + vyy), np.hypot(0.5 * (vxx - vyy), vxy)
    across = max(mean - spread, 0.0)
    if mean + spread < MIN_VARIANCE_M2 or across > MAX_THICKNESS_RATIO * (mean + spread):
        return mx, my, np.nan, np.nan, across
    angle = 0.5 * np.arctan2(2 * vxy, vxx - vyy) + 0.5 * np.pi
    return mx, my, np.cos(angle), np.sin(angle), across
