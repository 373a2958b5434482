"""The last step of a registration, from point to point to point to line, and how much of the pose it leaves open.

KISS-ICP says neither whether a cloud overlaps its map nor how well a pose is fixed, and the rings of a spinning LiDAR
pull it towards standing still along a wall. So its pose is refined here to the lines that the map's points make around
each nearest point, with the wheels' word as a prior, and judged by what is found there.

The covariance of such an estimate is H^-1 M H^-1 (the "sandwich" of Huber and White), with H the Hessian, and M the
sum of the outer products of the gradients as found; gradients are summed by square metre first, since points on one
piece of wall err together (Liang and Zeger's clusters). In a corridor H says next to nothing along it: that direction
is open.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.lidar.icp import IcpResult
from wayfi.frontends.lidar.line_fit import line_through
from wayfi.frontends.lidar.point_index import block_around, sort_by_cell

GATE_M = 0.5  # also the side of a cell: nearest points are looked for in 3 x 3 of them
CLUSTER_CELLS = 2
WALL_RADIUS_M = 0.35
KERNEL_M = 0.1  # Cauchy's: what is further from its wall is mostly something else
INLIER_M = 0.15
NOISE_M = 0.01  # of a range: residuals that happen to be smaller are luck
ITERATIONS = 6
SETTLED_M, SETTLED_RAD = 5e-4, 2e-5


def fit_cloud(points: Floats, map_points: Floats, start: Pose2, guess: Pose2, prior: Floats) -> IcpResult:
    """T_map_base of points (n, 3) in base_link among map points (p, 3), from `start`, with `prior` about `guess`.

    `prior` (3, 3) is information in the map's axes. Inliers are points within INLIER_M of a wall of the map, or of a
    point where there is no wall.
    """
    if len(points) == 0 or len(map_points) == 0:
        return IcpResult(start, np.zeros((3, 3)), 0.0, 0.0)
    order, cells = sort_by_cell(map_points, GATE_M)
    map_points = map_points[order]
    walls = np.full((len(map_points), 4), np.nan)
    pose = start.array()
    for _ in range(ITERATIONS):
        hessian, scatter, gradient, inliers, residual = _fit(points, map_points, *cells, walls, pose)
        step = _step(hessian, scatter, gradient, guess.array() - pose, prior)
        pose += step
        if np.hypot(step[0], step[1]) < SETTLED_M and abs(step[2]) < SETTLED_RAD:
            break
    information = hessian @ np.linalg.solve(scatter, hessian)
    return IcpResult(Pose2.of(pose), 0.5 * (information + information.T), inliers / len(points), residual)


def _step(hessian: Floats, scatter: Floats, gradient: Floats, to_guess: Floats, prior: Floats) -> Floats:
    """(3,) to where the cloud's information and the `prior` about the guess, `to_guess` (3,) away, balance."""
    to_guess[2] = wrap(to_guess[2])
    weighed = hessian @ np.linalg.inv(scatter)
    pull = prior @ to_guess - weighed @ gradient
    return np.asarray(np.linalg.solve(weighed @ hessian + prior, pull), np.float64)


@njit(cache=True)
def _fit(
    points: Floats, map_points: Floats, starts: NDArray[np.int64], origin: Floats, cell_m: float, rows: int,
    columns: int, walls: Floats, pose: Floats,
) -> tuple[Floats, Floats, Floats, int, float]:  # fmt: skip
    """Hessian, scatter of the gradients (3, 3), gradient (3,), the inliers and their mean distance, at a pose.

    `walls` (p, 4) takes in the walls of the map's points as they are asked for.
    """
    hessian, scatter = np.zeros((3, 3)), 1e-9 * np.eye(3)
    broad = columns // CLUSTER_CELLS + 1
    clusters = np.zeros(((rows // CLUSTER_CELLS + 1) * broad, 3))
    across = np.empty(3)
    inliers, total = 0, 0.0
    c, s = np.cos(pose[2]), np.sin(pose[2])
    for i in range(len(points)):
        rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        x, y = rx + pose[0], ry + pose[1]
        k, distance = _nearest(x, y, points[i, 2], map_points, starts, origin, cell_m, rows, columns)
        if k < 0:
            continue
        if np.isnan(walls[k, 0]):
            walls[k] = _wall(k, map_points, starts, origin, cell_m, rows, columns)
        nx, ny = walls[k, 0], walls[k, 1]
        error = nx * (x - walls[k, 2]) + ny * (y - walls[k, 3])
        off = abs(error) if nx != 0.0 or ny != 0.0 else distance
        if off < INLIER_M:
            inliers += 1
            total += off
        weight = 1.0 / (1.0 + (error / KERNEL_M) ** 2)
        across[0], across[1], across[2] = nx, ny, ny * rx - nx * ry
        row = int((map_points[k, 0] - origin[0]) / cell_m) // CLUSTER_CELLS
        column = int((map_points[k, 1] - origin[1]) / cell_m) // CLUSTER_CELLS
        for a in range(3):
            clusters[row * broad + column, a] += weight * error * across[a]
            for b in range(3):
                hessian[a, b] += weight * across[a] * across[b]
                scatter[a, b] += (weight * NOISE_M) ** 2 * across[a] * across[b]
    scatter += clusters.T @ clusters
    return hessian, scatter, clusters.sum(axis=0), inliers, total / max(inliers, 1)


@njit(cache=True)
def _nearest(
    x: float, y: float, z: float,
    points: Floats, starts: NDArray[np.int64], origin: Floats, cell_m: float, rows: int, columns: int,
) -> tuple[int, float]:  # fmt: skip
    """Row and distance of the point nearest to x, y, z within GATE_M; -1 if there is none."""
    best, best_square = -1, GATE_M * GATE_M
    top, bottom, left, right = block_around(x, y, origin, cell_m, rows, columns)
    for r in range(top, bottom):
        for k in range(starts[r * columns + left], starts[r * columns + right]):
            square = (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2 + (points[k, 2] - z) ** 2
            if square < best_square:
                best, best_square = k, square
    return best, np.sqrt(best_square)


@njit(cache=True)
def _wall(
    at: int, points: Floats, starts: NDArray[np.int64], origin: Floats, cell_m: float, rows: int, columns: int
) -> tuple[float, float, float, float]:
    """Level unit normal and middle of the wall that the points around one make; 0, 0 for the normal where none is."""
    x, y, z = points[at]
    count, sx, sy, sxx, sxy, syy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
    top, bottom, left, right = block_around(x, y, origin, cell_m, rows, columns)
    for r in range(top, bottom):
        for k in range(starts[r * columns + left], starts[r * columns + right]):
            dx, dy, dz = points[k, 0] - x, points[k, 1] - y, points[k, 2] - z
            if dx * dx + dy * dy + dz * dz < WALL_RADIUS_M**2:
                count, sx, sy = count + 1, sx + dx, sy + dy
                sxx, sxy, syy = sxx + dx * dx, sxy + dx * dy, syy + dy * dy
    mx, my, nx, ny, _ = line_through(count, sx, sy, sxx, sxy, syy)
    if count < 4 or np.isnan(nx):
        return 0.0, 0.0, x, y
    return nx, ny, x + mx, y + my
