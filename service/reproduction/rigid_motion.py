"""The rigid motion between two sequences of points: the paper's T*."""

import numpy as np
from numba import njit

from wayfi.backend.pose2 import Floats


@njit(cache=True)
def rigid_motion(source: Floats, target: Floats) -> Floats:
    """(3,) x, y, theta of the T that maps `source` (n, 2) to `target` (n, 2) with the least squares error.

    The closed form in the plane; the paper uses the SVD (Umeyama 1991, without scale).
    """
    n = source.shape[0]
    source_mean, target_mean = source.sum(axis=0) / n, target.sum(axis=0) / n
    s, t = source - source_mean, target - target_mean
    theta = np.arctan2((s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]).sum(), (s * t).sum())
    x, y = target_mean - _rotated(theta, source_mean[None])[0]
    return np.array([x, y, theta])


@njit(cache=True)
def mean_residual(T: Floats, source: Floats, target: Floats) -> float:
    """The mean distance (m) between `source` (n, 2), transformed by `T` (3,), and `target` (n, 2)."""
    left = _rotated(T[2], source) + T[:2] - target
    return float(np.hypot(left[:, 0], left[:, 1]).sum() / source.shape[0])


@njit(cache=True)
def _rotated(theta: float, points: Floats) -> Floats:
    c, s = np.cos(theta), np.sin(theta)
    rotated = np.empty_like(points)
    rotated[:, 0] = c * points[:, 0] - s * points[:, 1]
    rotated[:, 1] = s * points[:, 0] + c * points[:, 1]
    return rotated
