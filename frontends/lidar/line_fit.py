"""The line through points of the plane, from sums over them."""

import numpy as np
from numba import njit

THICK = 0.1  # the variance across a line over that along it, at the most
SMALL_M2 = 1e-8  # the variance of points that are one point


@njit(cache=True)
def line_through(
    count: int, x: float, y: float, xx: float, xy: float, yy: float
) -> tuple[float, float, float, float, float]:
    """The middle of `count` points, m, the unit normal of their line, and its thickness, a variance, m^2.

    `x`, `y`, `xx`, `xy` and `yy` are the sums of their coordinates (m) and of the products of these. Points that make
    no line have a normal of NaN.
    """
    mx, my = x / count, y / count
    vxx, vxy, vyy = xx / count - mx * mx, xy / count - mx * my, yy / count - my * my
    mean, spread = 0.5 * (vxx + vyy), np.hypot(0.5 * (vxx - vyy), vxy)
    thickness = max(mean - spread, 0.0)
    if mean + spread < SMALL_M2 or thickness > THICK * (mean + spread):
        return mx, my, np.nan, np.nan, thickness
    angle = 0.5 * np.arctan2(2 * vxy, vxx - vyy) + 0.5 * np.pi
    return mx, my, np.cos(angle), np.sin(angle), thickness
