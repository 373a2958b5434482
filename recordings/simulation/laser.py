"""A planar LiDAR: every face is drawn into the beams that it covers, the nearest face wins."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.recordings.simulation.surfaces import Surfaces

Floats = NDArray[np.float64]

# Hokuyo UST-20LX
BEAMS = 1081
ANGLE_MIN = math.radians(-135.0)
ANGLE_INCREMENT = math.radians(0.25)
RANGE_MIN_M = 0.06
RANGE_MAX_M = 20.0
SIGMA_M = 0.01
SIGMA_PER_M = 0.001
RESOLUTION_M = 0.001

SEAM_BEAMS = 1e-9  # so that no beam slips through where two faces meet


def scans(surfaces: Surfaces, poses: Floats, time_s: Floats, rng: np.random.Generator) -> NDArray[np.float32]:
    """(n, 1081) measured ranges (m, inf for no return) of a laser at `poses` (n, 3) and `time_s` (n,), with noise."""
    exact = ranges(surfaces, poses, time_s)
    noise = rng.standard_normal(exact.shape, dtype=np.float32)
    measured = exact + noise * (SIGMA_M + SIGMA_PER_M * np.where(np.isfinite(exact), exact, 0.0))
    measured = np.round(measured / RESOLUTION_M) * RESOLUTION_M
    measured[~((measured >= RANGE_MIN_M) & (measured <= RANGE_MAX_M))] = np.inf
    return measured.astype(np.float32)


def ranges(surfaces: Surfaces, poses: Floats, time_s: Floats) -> Floats:
    """(n, 1081) exact distances (m, inf beyond the range) to the nearest face from `poses` (n, 3) at `time_s` (n,)."""
    bearings = ANGLE_MIN + ANGLE_INCREMENT * np.arange(BEAMS)
    out = np.full((len(poses), BEAMS), np.inf)
    _draw_all(
        surfaces.ends, surfaces.since_s, surfaces.until_s, surfaces.velocity_xy,
        poses, time_s, np.cos(bearings), np.sin(bearings), out,
    )  # fmt: skip
    out[out > RANGE_MAX_M] = np.inf
    return out


@njit(cache=True)
def _draw_all(
    ends: Floats, since_s: Floats, until_s: Floats, velocity_xy: Floats,
    poses: Floats, time_s: Floats, cos_b: Floats, sin_b: Floats, out: Floats,
) -> None:  # fmt: skip
    for j in range(len(poses)):
        x, y = poses[j, 0], poses[j, 1]
        c, s = math.cos(poses[j, 2]), math.sin(poses[j, 2])
        for i in range(len(ends)):
            if not (since_s[i] <= time_s[j] < until_s[i]):
                continue
            x1, y1, x2, y2 = ends[i, 0] - x, ends[i, 1] - y, ends[i, 2] - x, ends[i, 3] - y
            if velocity_xy[i, 0] != 0.0 or velocity_xy[i, 1] != 0.0:
                dx, dy = velocity_xy[i] * (time_s[j] - since_s[i])
                x1, y1, x2, y2 = x1 + dx, y1 + dy, x2 + dx, y2 + dy
            if min(x1, x2) > RANGE_MAX_M or max(x1, x2) < -RANGE_MAX_M:
                continue
            if min(y1, y2) > RANGE_MAX_M or max(y1, y2) < -RANGE_MAX_M:
                continue
            _draw(c * x1 + s * y1, c * y1 - s * x1, c * x2 + s * y2, c * y2 - s * x2, cos_b, sin_b, out[j])


@njit(cache=True)
def _draw(x1: float, y1: float, x2: float, y2: float, cos_b: Floats, sin_b: Floats, out: Floats) -> None:
    """Lowers `out` where the face from (x1, y1) to (x2, y2), in the laser's frame, is nearer."""
    dx, dy = x2 - x1, y2 - y1
    cross = x1 * dy - y1 * dx
    start, end = (math.atan2(y1, x1), math.atan2(y2, x2)) if cross > 0 else (math.atan2(y2, x2), math.atan2(y1, x1))
    if end < start:
        end += 2 * math.pi
    for turn in (0.0, -2 * math.pi):
        first = max(math.ceil((start + turn - ANGLE_MIN) / ANGLE_INCREMENT - SEAM_BEAMS), 0)
        last = min(math.floor((end + turn - ANGLE_MIN) / ANGLE_INCREMENT + SEAM_BEAMS), len(out) - 1)
        for b in range(first, last + 1):
            across = cos_b[b] * dy - sin_b[b] * dx
            if across != 0.0:
                out[b] = min(out[b], cross / across)
