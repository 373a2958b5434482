"""From a laser scan to points in base_link: valid returns only, the sweep's motion undone, normals fitted, thinned."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.lidar.beam_counts import beams_between
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.line_fit import PointSums, fit_line
from wayfi.frontends.lidar.mount import Mount
from wayfi.frontends.measurements import LaserScan
from wayfi.frontends.scan_points import ScanPoints

MIN_RANGE_M = 0.02  # a UST-20LX's; nearer is the sensor's own window, whatever range_min the message states
SPACINGS = 2.5  # of the beams that a neighbour may be away: two to each side, and a half for a slanted wall
MAX_RADII = 3.0  # of `normal_radius_m`, at most: at 0.6 m a wall may have ended and another begun
HALF_AS_THICK = 0.25  # in variance: one side's line fits that much better where there is a corner
MIN_SINE = 0.1  # of a ray to its wall: at a smaller angle the normal's own error decides what length a beam covers


def valid_beams(scan: LaserScan, max_range_m: float) -> NDArray[np.int64]:
    """Indices (n,) of the beams with a return within `max_range_m`."""
    least_m, top_m = _limits(scan, max_range_m)
    return np.flatnonzero((scan.ranges > least_m) & (scan.ranges < top_m))


def sees_anything(scan: LaserScan, max_range_m: float) -> bool:
    """Whether a beam has a return within `max_range_m`."""
    return beams_between(scan.ranges, *_limits(scan, max_range_m)) > 0


def _limits(scan: LaserScan, max_range_m: float) -> tuple[float, float]:
    """The limits (m) between which the ranges of a scan are returns."""
    top_m = min(scan.range_max_m, max_range_m) if scan.range_max_m > 0 else max_range_m
    return max(scan.range_min_m, MIN_RANGE_M), top_m


def beam_points(scan: LaserScan, max_range_m: float) -> tuple[NDArray[np.int64], Floats]:
    """Indices (n,) of the beams with a return within `max_range_m`, and their (n, 2) points in the laser's frame, m."""
    beams = valid_beams(scan, max_range_m)
    bearings = scan.angle_min + beams * scan.angle_increment
    ranges = scan.ranges[beams].astype(np.float64)
    return beams, ranges[:, None] * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)


def to_base(points: Floats, mount: Mount, motion: Floats | None) -> Floats:
    """Points (n, 2) m of a laser in base_link.

    `motion` (n, 3) is T_base(reference)_base(beam), None for a sweep that takes no time.
    """
    if mount.upside_down:
        points = points * np.array([1.0, -1.0])
    points = mount.planar.transform(points)
    if motion is None:
        return points
    placed = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
    return np.ascontiguousarray(compose_all(motion, placed)[:, :2])


def scan_from_points(points: Floats, T_base_laser: Pose2, config: LidarConfig) -> ScanPoints:
    """The scan of (n, 2) `points` m in base_link, in beam order: moved onto their lines, with normals, and thinned."""
    origin = np.array([T_base_laser.x, T_base_laser.y])
    placed, normals = fit_normals(points, origin, config)
    kept = thin(placed, normals, origin, config.thinning_m)
    return ScanPoints(placed[kept], normals[kept], T_base_laser)


@njit(cache=True)
def transform_scans(
    points: Floats, normals: Floats, lengths: NDArray[np.int64], poses: Floats
) -> tuple[Floats, Floats]:
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


def fit_normals(points: Floats, origin: Floats, config: LidarConfig) -> tuple[Floats, Floats]:
    """Points (n, 2) m in beam order, moved onto the line through their neighbours, and its unit normals (n, 2).

    A neighbour counts within `normal_radius_m`, or within SPACINGS times the beams' spacing where that is more. The
    normals face the sensor at `origin` (2,). Where no line fits, the point stays and its normal is NaN.
    """
    lines = config.lines
    connected = _connected(points, origin, lines.shadow_m, lines.shadow_rad)
    return _fit_normals(points, origin, connected, config.normal_radius_m, lines.corner_m)


@njit(cache=True)
def _connected(points: Floats, origin: Floats, shadow_m: float, shadow_rad: float) -> NDArray[np.bool_]:
    """(n,) whether one wall may lead from each point to the next.

    Behind the edge of an obstacle the next point lies farther along almost the same ray: these are not connected.
    """
    connected = np.zeros(len(points), np.bool_)
    for i in range(len(points) - 1):
        x, y = points[i, 0] - origin[0], points[i, 1] - origin[1]
        dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        length = np.hypot(dx, dy)
        across = abs(x * dy - y * dx) / np.hypot(x, y)
        connected[i] = length < shadow_m or across > shadow_rad * length
    return connected


@njit(cache=True)
def _fit_normals(
    points: Floats, origin: Floats, connected: NDArray[np.bool_], radius_m: float, corner_m: float
) -> tuple[Floats, Floats]:
    n = points.shape[0]
    normals = np.full((n, 2), np.nan)
    placed = points.copy()
    sums = _running_sums(points, origin)
    for i in range(n):
        reach_m = _neighbour_reach_m(points, i, radius_m)
        first, last = i, i + 1
        while first > 0 and connected[first - 1] and _is_near(points, i, first - 1, reach_m):
            first -= 1
        while last < n and connected[last - 1] and _is_near(points, i, last, reach_m):
            last += 1
        point = points[i, 0] - origin[0], points[i, 1] - origin[1]
        x, y, nx, ny = _line_at(sums, point, first, i, last, corner_m)
        if np.isnan(nx):
            continue
        if nx * (origin[0] - points[i, 0]) + ny * (origin[1] - points[i, 1]) < 0:
            nx, ny = -nx, -ny
        normals[i, 0], normals[i, 1] = nx, ny
        off = nx * x + ny * y
        placed[i, 0], placed[i, 1] = points[i, 0] + off * nx, points[i, 1] + off * ny
    return placed, normals


@njit(cache=True)
def _running_sums(points: Floats, origin: Floats) -> Floats:
    """(n + 1, 5) sums over the points before each of x, y (m, from the sensor), xx, xy and yy."""
    sums = np.zeros((len(points) + 1, 5))
    for i in range(len(points)):
        x, y = points[i, 0] - origin[0], points[i, 1] - origin[1]
        sums[i + 1, 0], sums[i + 1, 1] = sums[i, 0] + x, sums[i, 1] + y
        sums[i + 1, 2], sums[i + 1, 3], sums[i + 1, 4] = sums[i, 2] + x * x, sums[i, 3] + x * y, sums[i, 4] + y * y
    return sums


@njit(cache=True)
def _is_near(points: Floats, i: int, j: int, reach_m: float) -> bool:
    dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
    near: bool = dx * dx + dy * dy <= reach_m * reach_m
    return near


@njit(cache=True)
def _neighbour_reach_m(points: Floats, i: int, radius_m: float) -> float:
    """How far (m) a neighbour of point i may be."""
    near = np.inf
    for j in (i - 1, i + 1):
        if 0 <= j < points.shape[0]:
            near = min(near, np.hypot(points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]))
    return max(radius_m, min(SPACINGS * near, MAX_RADII * radius_m))


@njit(cache=True)
def _line_at(
    sums: Floats, point: tuple[float, float], first: int, i: int, last: int, corner_m: float
) -> tuple[float, float, float, float]:
    """The line of point i through points first..last (excluded): centroid x, y from the point, m, and unit normal.

    Near a corner, where that line is thick, it is the line of the better side alone.
    """
    line = _fit_line(sums, point, first, last)
    if not line[4] > corner_m * corner_m:
        return line[0], line[1], line[2], line[3]
    before, after = _fit_line(sums, point, first, i + 1), _fit_line(sums, point, i, last)
    side = before if before[4] < after[4] else after
    if side[4] < HALF_AS_THICK * line[4] and not np.isnan(side[2]):
        line = side
    return line[0], line[1], line[2], line[3]


@njit(cache=True)
def _fit_line(
    sums: Floats, point: tuple[float, float], first: int, last: int
) -> tuple[float, float, float, float, float]:
    """The line through points first..last (excluded), by their running sums; `point` is from the sensor, m.

    Centroid x, y from `point` (m), unit normal x, y, and the variance across (m^2), without bias: two degrees of
    freedom belong to the line. Of fewer than 3 points the normal is NaN and the variance infinite.
    """
    n = last - first
    if n < 3:
        return 0.0, 0.0, np.nan, np.nan, np.inf
    px, py = point
    x, y = sums[last, 0] - sums[first, 0], sums[last, 1] - sums[first, 1]
    xx, xy = sums[last, 2] - sums[first, 2], sums[last, 3] - sums[first, 3]
    yy = sums[last, 4] - sums[first, 4]
    about_point = PointSums(
        n, x - n * px, y - n * py, xx - 2 * px * x + n * px * px, xy - px * y - py * x + n * px * py,
        yy - 2 * py * y + n * py * py,
    )  # fmt: skip
    mx, my, nx, ny, across = fit_line(about_point)
    return mx, my, nx, ny, across * n / (n - 2)


@njit(cache=True)
def thin(points: Floats, normals: Floats, origin: Floats, spacing_m: float) -> NDArray[np.int64]:
    """Indices of points (n, 2) in beam order, about `spacing_m` of wall apart; the sensor is at `origin` (2,).

    The length of wall is measured by the angle between beams, not from point to point. Otherwise the ranges' noise
    chooses the points, those beyond a wall on one side of the sensor and before it on the other, and scan matching
    turns by 0.1 mrad a metre.
    """
    kept = np.empty(points.shape[0], np.int64)
    count = 0
    wall_m = np.inf
    for i in range(points.shape[0]):
        if i > 0:
            wall_m += _wall_length_m(points, i, origin, normals)
        if wall_m >= spacing_m:
            kept[count] = i
            count += 1
            wall_m = 0.0
    return kept[:count]


@njit(cache=True)
def _wall_length_m(points: Floats, i: int, origin: Floats, normals: Floats) -> float:
    """Length (m) of wall from the point before to point i; from one to the other where no normal is known."""
    before_x, before_y = points[i - 1, 0] - origin[0], points[i - 1, 1] - origin[1]
    x, y = points[i, 0] - origin[0], points[i, 1] - origin[1]
    facing = abs(x * normals[i, 0] + y * normals[i, 1])
    wall_m: float = np.hypot(x - before_x, y - before_y)
    if facing > MIN_SINE * np.hypot(x, y):
        turned = abs(before_x * y - before_y * x) / np.hypot(before_x, before_y)
        wall_m = turned * np.hypot(x, y) / facing
    return wall_m
