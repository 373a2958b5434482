"""The rigid motion that lays one sequence of places over another: the paper's T*."""

import numpy as np
from numba import njit

from wayfi.backend.pose2 import Floats


@njit(cache=True)
def rigid_motion(source: Floats, target: Floats) -> Floats:
    """(3,) x, y, theta of the T that brings `source` (n, 2) nearest to `target` (n, 2), in least squares.

    The closed form in the plane of what the paper finds by SVD (Umeyama 1991, without scale).
    """
    n = source.shape[0]
    source_mean, target_mean = source.sum(axis=0) / n, target.sum(axis=0) / n
    s, t = source - source_mean, target - target_mean
    theta = np.arctan2((s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]).sum(), (s * t).sum())
    x, y = target_mean - _turned(theta, source_mean[None])[0]
    return np.array([x, y, theta])


@njit(cache=True)
def mean_residual(T: Floats, source: Floats, target: Floats) -> float:
    """The mean distance (m) of `source` (n, 2), moved by `T` (3,), from `target` (n, 2)."""
    left = _turned(T[2], source) + T[:2] - target
    return float(np.hypot(left[:, 0], left[:, 1]).sum() / source.shape[0])


@njit(cache=True)
def _turned(theta: float, points: Floats) -> Floats:
    c, s = np.cos(theta), np.sin(theta)
    turned = np.empty_like(points)
    turned[:, 0] = c * points[:, 0] - s * points[:, 1]
    turned[:, 1] = s * points[:, 0] + c * points[:, 1]
    return turned
