"""The last step of matching a cloud: a point-to-line fit, its inliers and its covariance.

KISS-ICP reports neither whether a cloud overlaps its map nor how well a pose is fixed, and along a wall the rings of a
spinning LiDAR bias it towards no motion. So its pose is refined to the lines that the map's points make around
each nearest point, with the wheels as a prior.

The covariance of such an estimate is H^-1 M H^-1 (the "sandwich" of Huber and White), with H the Hessian, and M the
sum of the outer products of the gradients; gradients are summed by square metre first, since points on one piece of
wall err together (Liang and Zeger's clusters). In a corridor H is next to zero along it: that direction is open.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.lidar.icp import IcpResult
from wayfi.frontends.lidar.lidar_config import CloudFitConfig
from wayfi.frontends.lidar.line_fit import NO_POINTS, add_point, fit_line
from wayfi.frontends.lidar.point_index import CellGrid, block_around, sort_by_cell

SETTLED_M, SETTLED_RAD = 5e-4, 2e-5  # a quarter of a cloud's sigma floor, and 0.5 mm at 25 m: steps end below it
MIN_WALL_POINTS = 4  # two fix a line, two more confirm it
MIN_SCATTER = 1e-9  # keeps M invertible where nothing was found: far below the (1 cm)^2 of a single point


class _FitParams(NamedTuple):
    """CloudFitConfig as compiled code takes it."""

    gate_m: float
    wall_radius_m: float
    kernel_m: float
    inlier_m: float
    noise_m: float
    cluster_cells: int

    @classmethod
    def of(cls, config: CloudFitConfig) -> "_FitParams":
        return cls(
            config.gate_m, config.wall_radius_m, config.kernel_m, config.inlier_m, config.noise_m, config.cluster_cells
        )


def fit_cloud(
    points: Floats, map_points: Floats, start: Pose2, guess: Pose2, prior: Floats, config: CloudFitConfig
) -> IcpResult:
    """T_map_base of points (n, 3) m in base_link among map points (p, 3), from `start`, with `prior` about `guess`.

    `prior` (3, 3) is information in the map's axes. Inliers are points within `inlier_m` of a wall of the map, or of a
    point where there is no wall.
    """
    if len(points) == 0 or len(map_points) == 0:
        return IcpResult(start, np.zeros((3, 3)), 0.0, 0.0)
    order, cells = sort_by_cell(map_points, config.gate_m)
    map_points = map_points[order]
    walls = np.full((len(map_points), 4), np.nan)
    pose, params = start.array(), _FitParams.of(config)
    for _ in range(config.iterations):
        hessian, scatter, gradient, inliers, residual_m = _normal_equations(
            points, map_points, cells, walls, pose, params
        )
        step = _step(hessian, scatter, gradient, guess.array() - pose, prior)
        pose += step
        if np.hypot(step[0], step[1]) < SETTLED_M and abs(step[2]) < SETTLED_RAD:
            break
    information = hessian @ np.linalg.solve(scatter, hessian)
    return IcpResult(Pose2.of(pose), 0.5 * (information + information.T), inliers / len(points), residual_m)


def _step(hessian: Floats, scatter: Floats, gradient: Floats, to_guess: Floats, prior: Floats) -> Floats:
    """(3,) to the pose that the cloud's information and the `prior` about the guess, `to_guess` (3,) away, give."""
    to_guess[2] = wrap(to_guess[2])
    weighted = hessian @ np.linalg.inv(scatter)
    pull = prior @ to_guess - weighted @ gradient
    return np.asarray(np.linalg.solve(weighted @ hessian + prior, pull), np.float64)


@njit(cache=True)
def _normal_equations(
    points: Floats, map_points: Floats, cells: CellGrid, walls: Floats, pose: Floats, params: _FitParams
) -> tuple[Floats, Floats, Floats, int, float]:
    """Hessian, scatter of the gradients (3, 3), gradient (3,), the inliers and their mean distance (m), at a pose.

    `walls` (p, 4) caches what `_wall` gives for the map's points, NaN where it was not asked yet.
    """
    hessian, scatter = np.zeros((3, 3)), MIN_SCATTER * np.eye(3)
    cluster_columns = cells.columns // params.cluster_cells + 1
    clusters = np.zeros(((cells.rows // params.cluster_cells + 1) * cluster_columns, 3))
    J = np.empty(3)
    inliers, total_m = 0, 0.0
    c, s = np.cos(pose[2]), np.sin(pose[2])
    for i in range(len(points)):
        rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        x, y = rx + pose[0], ry + pose[1]
        k, distance = _nearest(x, y, points[i, 2], params.gate_m, map_points, cells)
        if k < 0:
            continue
        if np.isnan(walls[k, 0]):
            walls[k] = _wall(k, params.wall_radius_m, map_points, cells)
        nx, ny = walls[k, 0], walls[k, 1]
        error = nx * (x - walls[k, 2]) + ny * (y - walls[k, 3])
        off_m = abs(error) if nx != 0.0 or ny != 0.0 else distance
        if off_m < params.inlier_m:
            inliers += 1
            total_m += off_m
        weight = 1.0 / (1.0 + (error / params.kernel_m) ** 2)
        J[0], J[1], J[2] = nx, ny, ny * rx - nx * ry
        row = int((map_points[k, 0] - cells.origin[0]) / cells.cell_m) // params.cluster_cells
        column = int((map_points[k, 1] - cells.origin[1]) / cells.cell_m) // params.cluster_cells
        for a in range(3):
            clusters[row * cluster_columns + column, a] += weight * error * J[a]
            for b in range(3):
                hessian[a, b] += weight * J[a] * J[b]
                scatter[a, b] += (weight * params.noise_m) ** 2 * J[a] * J[b]
    scatter += clusters.T @ clusters
    return hessian, scatter, clusters.sum(axis=0), inliers, total_m / max(inliers, 1)


@njit(cache=True)
def _nearest(x: float, y: float, z: float, gate_m: float, points: Floats, cells: CellGrid) -> tuple[int, float]:
    """Row and distance (m) of the point nearest to x, y, z within `gate_m`; -1 if there is none."""
    best, best_square = -1, gate_m * gate_m
    top, bottom, left, right = block_around(x, y, cells)
    for r in range(top, bottom):
        for k in range(cells.starts[r * cells.columns + left], cells.starts[r * cells.columns + right]):
            square = (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2 + (points[k, 2] - z) ** 2
            if square < best_square:
                best, best_square = k, square
    return best, np.sqrt(best_square)


@njit(cache=True)
def _wall(at: int, radius_m: float, points: Floats, cells: CellGrid) -> tuple[float, float, float, float]:
    """Unit normal in the plane and centroid (m) of the wall that the points around one make; normal 0, 0 if none."""
    x, y, z = points[at]
    sums = NO_POINTS
    top, bottom, left, right = block_around(x, y, cells)
    for r in range(top, bottom):
        for k in range(cells.starts[r * cells.columns + left], cells.starts[r * cells.columns + right]):
            dx, dy, dz = points[k, 0] - x, points[k, 1] - y, points[k, 2] - z
            if dx * dx + dy * dy + dz * dz < radius_m**2:
                sums = add_point(sums, dx, dy)
    mx, my, nx, ny, _ = fit_line(sums)
    if sums.n < MIN_WALL_POINTS or np.isnan(nx):
        return 0.0, 0.0, x, y
    return nx, ny, x + mx, y + my
