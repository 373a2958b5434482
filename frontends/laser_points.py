"""From a laser scan to points in base_link: no returns left out, the sweep's motion undone, normals along the walls."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.measurements import LaserScan, StaticTransform

NEAREST_M = 0.02  # nearer is the sensor's own window, whatever the message says


@dataclass(frozen=True, slots=True, eq=False)
class ScanPoints:
    """One sweep in base_link at one moment: `points` (n, 2) m, their `normals` (n, 2; NaN where unknown).

    `T_base_laser` is where the sensor stands; `free_ends` (m, 2) m are the ends of beams without a return that may be
    taken as free.
    """

    points: Floats
    normals: Floats
    T_base_laser: Pose2


def returns(scan: LaserScan, max_range_m: float) -> NDArray[np.int64]:
    """Indices (n,) of the beams with a return within `max_range_m`."""
    top = min(scan.range_max_m, max_range_m) if scan.range_max_m > 0 else max_range_m
    return np.flatnonzero((scan.ranges > max(scan.range_min_m, NEAREST_M)) & (scan.ranges < top))


def beam_points(scan: LaserScan, max_range_m: float) -> tuple[NDArray[np.int64], Floats]:
    """Indices (n,) of the beams with a return within `max_range_m`, and their (n, 2) points in the laser's frame."""
    beams = returns(scan, max_range_m)
    bearings = scan.angle_min + beams * scan.angle_increment
    ranges = scan.ranges[beams].astype(np.float64)
    return beams, ranges[:, None] * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)


def to_base(points: Floats, T_base_laser: Pose2, upside_down: bool, motion: Floats | None) -> Floats:
    """(n, 2) points of the laser in base_link.

    `motion` (n, 3) is T_base(reference)_base(beam), None for an instant sweep.
    """
    if upside_down:
        points = points * np.array([1.0, -1.0])
    points = T_base_laser.transform(points)
    if motion is None:
        return points
    placed = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
    return np.ascontiguousarray(compose_all(motion, placed)[:, :2])


def planar_mount(transform: StaticTransform) -> tuple[Pose2, bool]:
    """T_base_laser in the plane, and whether the laser hangs upside down."""
    x, y, z, w = transform.rotation_xyzw
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    upside_down = 1 - 2 * (x * x + y * y) < 0
    return Pose2(transform.translation_xyz[0], transform.translation_xyz[1], yaw), upside_down


@njit(cache=True)
def place_all(points: Floats, normals: Floats, lengths: NDArray[np.int64], poses: Floats) -> tuple[Floats, Floats]:
    """Several scans' points and normals (n, 2), `lengths` (m,) of each after the other, moved by their (m, 3) poses."""
    placed, turned = np.empty_like(points), np.empty_like(normals)
    i = 0
    for k in range(lengths.shape[0]):
        c, s = np.cos(poses[k, 2]), np.sin(poses[k, 2])
        for _ in range(lengths[k]):
            placed[i, 0] = c * points[i, 0] - s * points[i, 1] + poses[k, 0]
            placed[i, 1] = s * points[i, 0] + c * points[i, 1] + poses[k, 1]
            turned[i, 0] = c * normals[i, 0] - s * normals[i, 1]
            turned[i, 1] = s * normals[i, 0] + c * normals[i, 1]
            i += 1
    return placed, turned


@njit(cache=True)
def normals_along(points: Floats, origin: Floats, reach: int, radius_m: float) -> Floats:
    """(n, 2) unit normals of points (n, 2) in beam order, from up to `reach` neighbours a side; NaN where no line fits.

    A neighbour counts within `radius_m`, or within 2.5 times the beams' spacing there; `origin` (2,) is the sensor.
    """
    n = points.shape[0]
    normals = np.full((n, 2), np.nan)
    for i in range(n):
        px, py = points[i, 0], points[i, 1]
        near = 1e9
        for j in (i - 1, i + 1):
            if 0 <= j < n:
                near = min(near, np.hypot(points[j, 0] - px, points[j, 1] - py))
        limit = max(radius_m, min(2.5 * near, 3 * radius_m))
        count, mx, my, sxx, sxy, syy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(max(i - reach, 0), min(i + reach + 1, n)):
            dx, dy = points[j, 0] - px, points[j, 1] - py
            if dx * dx + dy * dy <= limit * limit:
                count += 1
                mx += dx
                my += dy
                sxx += dx * dx
                sxy += dx * dy
                syy += dy * dy
        if count < 3:
            continue
        mx, my = mx / count, my / count
        sxx, sxy, syy = sxx / count - mx * mx, sxy / count - mx * my, syy / count - my * my
        mean, spread = 0.5 * (sxx + syy), np.hypot(0.5 * (sxx - syy), sxy)
        if mean + spread < 1e-8 or (mean - spread) > 0.1 * (mean + spread):
            continue
        angle = 0.5 * np.arctan2(2 * sxy, sxx - syy) + np.pi / 2
        nx, ny = np.cos(angle), np.sin(angle)
        if nx * (origin[0] - px) + ny * (origin[1] - py) < 0:
            nx, ny = -nx, -ny
        normals[i, 0], normals[i, 1] = nx, ny
    return normals


@njit(cache=True)
def thin(points: Floats, spacing_m: float) -> NDArray[np.int64]:
    """Indices of points (n, 2) in beam order such that each stands `spacing_m` or more from the one kept before it."""
    kept = np.empty(points.shape[0], np.int64)
    count = 0
    lx, ly = np.inf, np.inf
    for i in range(points.shape[0]):
        if np.hypot(points[i, 0] - lx, points[i, 1] - ly) >= spacing_m:
            kept[count] = i
            count += 1
            lx, ly = points[i, 0], points[i, 1]
    return kept[:count]
