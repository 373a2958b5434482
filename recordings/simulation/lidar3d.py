"""A spinning LiDAR of 16 beams, modelled on Velodyne's VLP-16, with the motion of the robot during a turn.

It sees walls, cars and people up to their height, floor and ceiling, but no glass.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.recordings.simulation.surfaces import Material, Surfaces

Floats = NDArray[np.float64]

ELEVATIONS = np.radians(np.arange(-15.0, 16.0, 2.0))
COLUMNS = 900
SWEEP_S = 0.1
RANGE_MIN_M = 0.4
RANGE_MAX_M = 100.0
SIGMA_M = 0.015
RESOLUTION_M = 0.002
HEIGHT_M = 0.7  # of the sensor above the floor

CEILING_M = 2.8
CAR_HEIGHT_M, CAR_LENGTHS_M = 1.5, (1.0, 6.0)
PERSON_HEIGHT_M = 1.75
JOINT_M = 1e-6  # faces whose ends are so near belong to one shape


def sweep(
    surfaces: Surfaces, heights_m: Floats, poses: Floats, start_s: float, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """A turn: points (n, 3) m, each in the sensor's frame at its own time, and their seconds (n,) since `start_s`.

    `poses` (COLUMNS, 3) are the sensor's at each column, the first at `start_s` from the start of the drive. The sensor
    turns clockwise from straight ahead. `heights_m` (m,) are the heights of the faces of `surfaces`.
    """
    level = level_distances(surfaces, heights_m, poses, start_s)
    exact = level / np.cos(ELEVATIONS)
    measured = exact + SIGMA_M * rng.standard_normal(exact.shape, dtype=np.float32)
    measured = np.round(measured / RESOLUTION_M) * RESOLUTION_M
    column, channel = np.nonzero((measured >= RANGE_MIN_M) & (measured <= RANGE_MAX_M))
    ranges, bearings, elevations = measured[column, channel], column_bearings()[column], ELEVATIONS[channel]
    level_ranges = ranges * np.cos(elevations)
    points = np.column_stack(
        [level_ranges * np.cos(bearings), level_ranges * np.sin(bearings), ranges * np.sin(elevations)]
    )
    return points.astype(np.float32), (column * (SWEEP_S / COLUMNS)).astype(np.float32)


def column_bearings() -> Floats:
    """(COLUMNS,) bearing of each column in the sensor's frame, rad."""
    bearings: Floats = -2 * math.pi / COLUMNS * np.arange(COLUMNS, dtype=np.float64)
    return bearings


def column_times(start_s: float) -> Floats:
    """(COLUMNS,) the time (s) of each column of the turn that begins at `start_s`."""
    times: Floats = start_s + SWEEP_S / COLUMNS * np.arange(COLUMNS, dtype=np.float64)
    return times


def heights(surfaces: Surfaces) -> Floats:
    """(n,) heights (m) of the faces, derived from the size of the closed shape that they belong to.

    A shape of a car's length has the height of a car. A smaller one is a person if it appears or disappears, else a
    pillar. Pillars and all larger shapes reach the ceiling.
    """
    ends = surfaces.ends
    begins = np.r_[True, (np.abs(ends[1:, :2] - ends[:-1, 2:]) > JOINT_M).any(axis=1)]
    starts = np.flatnonzero(begins)
    low = np.minimum.reduceat(np.minimum(ends[:, :2], ends[:, 2:]), starts)
    high = np.maximum.reduceat(np.maximum(ends[:, :2], ends[:, 2:]), starts)
    length = (high - low).max(axis=1)[np.cumsum(begins) - 1]
    stays = np.isinf(surfaces.since_s) & np.isinf(surfaces.until_s)
    out = np.full(len(ends), CEILING_M)
    out[(length >= CAR_LENGTHS_M[0]) & (length <= CAR_LENGTHS_M[1])] = CAR_HEIGHT_M
    out[(length < CAR_LENGTHS_M[0]) & ~stays] = PERSON_HEIGHT_M
    return out


def level_distances(surfaces: Surfaces, heights_m: Floats, poses: Floats, start_s: float) -> Floats:
    """(COLUMNS, 16) exact horizontal distances (m) to the first hit of each beam, from `poses` (COLUMNS, 3)."""
    slopes = np.tan(ELEVATIONS)
    across = np.where(slopes < 0, -HEIGHT_M, CEILING_M - HEIGHT_M) / slopes
    out: Floats = np.tile(across, (COLUMNS, 1))
    headings = poses[:, 2] + column_bearings()
    there = (surfaces.since_s <= start_s) & (start_s < surfaces.until_s) & (surfaces.material != Material.GLASS)
    elapsed = np.where(np.isfinite(surfaces.since_s), start_s - surfaces.since_s, 0.0)
    shift = surfaces.velocity_xy * elapsed[:, None]
    _draw_all(
        (surfaces.ends + np.hstack([shift, shift]))[there], surfaces.velocity_xy[there], heights_m[there],
        poses, np.cos(headings), np.sin(headings), slopes, out,
    )  # fmt: skip
    return out


@njit(cache=True)
def _draw_all(
    ends: Floats, velocity_xy: Floats, heights_m: Floats,
    poses: Floats, along_x: Floats, along_y: Floats, slopes: Floats, out: Floats,
) -> None:  # fmt: skip
    """Reduce `out` where a face is nearer: `ends` (n, 4) at the first column, moving by `velocity_xy`."""
    for i in range(len(ends)):
        first, count = _columns_of(ends[i], velocity_xy[i], poses)
        for step in range(count):
            c = (first + step) % COLUMNS
            elapsed = SWEEP_S / COLUMNS * c
            ax = ends[i, 0] + velocity_xy[i, 0] * elapsed - poses[c, 0]
            ay = ends[i, 1] + velocity_xy[i, 1] * elapsed - poses[c, 1]
            dx, dy = ends[i, 2] - ends[i, 0], ends[i, 3] - ends[i, 1]
            across = along_x[c] * dy - along_y[c] * dx
            if across == 0.0:
                continue
            level = (ax * dy - ay * dx) / across
            share = (ax * along_y[c] - ay * along_x[c]) / across
            if level <= 0.0 or share < -1e-9 or share > 1.0 + 1e-9:
                continue
            for k in range(len(slopes)):
                z = HEIGHT_M + level * slopes[k]
                if level < out[c, k] and 0.0 <= z <= heights_m[i]:
                    out[c, k] = level


@njit(cache=True)
def _columns_of(face: Floats, velocity_xy: Floats, poses: Floats) -> tuple[int, int]:
    """The first column that may hit a face, and their number: from the middle of the turn, with a margin."""
    middle = poses[COLUMNS // 2]
    x1, y1, x2, y2 = face[0] - middle[0], face[1] - middle[1], face[2] - middle[0], face[3] - middle[1]
    dx, dy = x2 - x1, y2 - y1
    share = min(max(-(x1 * dx + y1 * dy) / max(dx * dx + dy * dy, 1e-12), 0.0), 1.0)
    distance = math.hypot(x1 + share * dx, y1 + share * dy)
    if distance > RANGE_MAX_M:
        return 0, 0
    moved = math.hypot(poses[-1, 0] - poses[0, 0], poses[-1, 1] - poses[0, 1])
    moved += math.hypot(velocity_xy[0], velocity_xy[1]) * SWEEP_S
    if distance <= 2 * moved + 1e-3:
        return 0, COLUMNS
    turned = (poses[-1, 2] - poses[0, 2] + math.pi) % (2 * math.pi) - math.pi
    margin = abs(turned) + math.asin(moved / distance)
    start, span = math.atan2(y1, x1), math.atan2(x1 * y2 - y1 * x2, x1 * x2 + y1 * y2)
    top = max(start, start + span) + margin - middle[2]
    columns_per_rad = COLUMNS / (2 * math.pi)
    count = min(int((abs(span) + 2 * margin) * columns_per_rad) + 3, COLUMNS)
    return math.floor(-top * columns_per_rad) - 1, count
