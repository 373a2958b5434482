"""From a laser scan to points in base_link: no returns left out, the sweep's motion undone, normals along the walls."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.lidar.line_fit import line_through
from wayfi.frontends.measurements import LaserScan, StaticTransform
from wayfi.frontends.scan_points import ScanPoints

NEIGHBOURS = 5  # to each side of a beam that may make a wall with it
CORNER_M = 0.03  # a line thicker than this may be two: beyond what noise makes of a wall
SHADOW_M, SHADOW_RAD = 0.1, 0.1  # from an edge to what lies behind it: a gap this long, this near to the ray
NEAREST_M = 0.02  # nearer is the sensor's own window, whatever the message says


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


def walls_seen(points: Floats, T_base_laser: Pose2, normal_radius_m: float, thinning_m: float) -> ScanPoints:
    """The scan of (n, 2) `points` in base_link, in beam order: on their walls, with normals, `thinning_m` apart."""
    origin = np.array([T_base_laser.x, T_base_laser.y])
    placed, normals = lines_along(points, origin, normal_radius_m)
    kept = thin(placed, normals, origin, thinning_m)
    return ScanPoints(placed[kept], normals[kept], T_base_laser)


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
def lines_along(points: Floats, origin: Floats, radius_m: float) -> tuple[Floats, Floats]:
    """Points (n, 2) in beam order, moved onto the line through their neighbours, and its unit normals (n, 2).

    Up to NEIGHBOURS a side; one counts within `radius_m`, or within 2.5 times the beams' spacing. The normals face the
    sensor at `origin` (2,). Where no line fits, the point stays and its normal is NaN.
    """
    n = points.shape[0]
    normals = np.full((n, 2), np.nan)
    placed = points.copy()
    joined = _joined(points, origin)
    for i in range(n):
        limit = _limit(points, i, radius_m)
        first, last = i, i + 1
        while first > max(i - NEIGHBOURS, 0) and joined[first - 1]:
            first -= 1
        while last < min(i + NEIGHBOURS + 1, n) and joined[last - 1]:
            last += 1
        line = _line(points, i, first, last, limit)
        before = _line(points, i, first, i + 1, limit)
        after = _line(points, i, i, last, limit)
        side = before if before[4] < after[4] else after
        if line[4] > CORNER_M * CORNER_M and side[4] < 0.25 * line[4] and not np.isnan(side[2]):
            line = side
        nx, ny = line[2], line[3]
        if np.isnan(nx):
            continue
        if nx * (origin[0] - points[i, 0]) + ny * (origin[1] - points[i, 1]) < 0:
            nx, ny = -nx, -ny
        normals[i, 0], normals[i, 1] = nx, ny
        off = nx * line[0] + ny * line[1]
        placed[i, 0], placed[i, 1] = points[i, 0] + off * nx, points[i, 1] + off * ny
    return placed, normals


@njit(cache=True)
def _joined(points: Floats, origin: Floats) -> NDArray[np.bool_]:
    """(n,) whether a wall may lead from each point to the next; what lies behind an edge starts in line with it."""
    joined = np.zeros(len(points), np.bool_)
    for i in range(len(points) - 1):
        ray, gap = points[i] - origin, points[i + 1] - points[i]
        length = np.hypot(gap[0], gap[1])
        across = abs(ray[0] * gap[1] - ray[1] * gap[0]) / np.hypot(ray[0], ray[1])
        joined[i] = length < SHADOW_M or across > SHADOW_RAD * length
    return joined


@njit(cache=True)
def _limit(points: Floats, i: int, radius_m: float) -> float:
    """How far (m) a neighbour of point i may be."""
    near = np.inf
    for j in (i - 1, i + 1):
        if 0 <= j < points.shape[0]:
            near = min(near, np.hypot(points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]))
    return max(radius_m, min(2.5 * near, 3 * radius_m))


@njit(cache=True)
def _line(points: Floats, i: int, first: int, last: int, limit_m: float) -> tuple[float, float, float, float, float]:
    """The line through points first..last (excluded) near point i: its middle from point i, its normal, its thickness.

    Where there is no line, the normal is NaN. The thickness is a variance, m^2; infinite of fewer than 3 points.
    """
    count, x, y, xx, xy, yy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(first, last):
        dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
        if dx * dx + dy * dy <= limit_m * limit_m:
            count += 1
            x += dx
            y += dy
            xx += dx * dx
            xy += dx * dy
            yy += dy * dy
    if count < 3:
        return 0.0, 0.0, np.nan, np.nan, np.inf
    mx, my, nx, ny, thickness = line_through(count, x, y, xx, xy, yy)
    return mx, my, nx, ny, thickness * count / (count - 2)


@njit(cache=True)
def thin(points: Floats, normals: Floats, origin: Floats, spacing_m: float) -> NDArray[np.int64]:
    """Indices of points (n, 2) in beam order, about `spacing_m` of wall apart; the sensor is at `origin` (2,).

    Wall is measured by the angle between beams, not from point to point: else the beams' noise chooses the points,
    those beyond a wall on one side of the sensor and before it on the other, and scan matching turns by 0.1 mrad a
    metre.
    """
    kept = np.empty(points.shape[0], np.int64)
    count = 0
    wall_m = np.inf
    for i in range(points.shape[0]):
        if i > 0:
            wall_m += _wall_between(points[i - 1] - origin, points[i] - origin, normals[i])
        if wall_m >= spacing_m:
            kept[count] = i
            count += 1
            wall_m = 0.0
    return kept[:count]


@njit(cache=True)
def _wall_between(before: Floats, ray: Floats, normal: Floats) -> float:
    """Length (m) of the wall of `normal` from one ray (2,) m to the next; from end to end where no normal is known."""
    facing = abs(ray[0] * normal[0] + ray[1] * normal[1])
    wall_m: float = np.hypot(ray[0] - before[0], ray[1] - before[1])
    if facing > 0.1 * np.hypot(ray[0], ray[1]):
        turned = abs(before[0] * ray[1] - before[1] * ray[0]) / np.hypot(before[0], before[1])
        wall_m = turned * np.hypot(ray[0], ray[1]) / facing
    return wall_m
