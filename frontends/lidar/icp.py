"""Point-to-line ICP in the plane, with the motion model as a prior and a covariance from its Hessian.

Point-to-line after Censi, "An ICP variant using a point-to-line metric" (ICRA 2008), with an annealed Cauchy kernel. A
direction that the walls do not constrain is left to the prior, and the covariance says so.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.point_index import PointIndex, nearest
from wayfi.frontends.scan_points import ScanPoints


@dataclass(frozen=True)
class IcpConfig:
    """Bounds and weights of one ICP."""

    iterations: int = option(20, "", "the first guess is within 0.3 m; it settles in 6 to 12")
    gate_start_m: float = option(0.8, "m", "how far the first guess may be off")
    gate_end_m: float = option(0.2, "m", "wider takes in furniture that is not in the submap")
    inlier_m: float = option(0.12, "m", "three times a laser's noise plus the spacing of the points")
    sigma_m: float = option(0.03, "m", "noise of a range and of the wall that it is compared with, at the first guess")
    least_sigma_m: float = option(0.01, "m", "the residuals tell the noise; a good laser's is no less")
    max_turned_rad: float = option(0.8, "rad", "between a point's normal and its wall's; beyond, it is another face")
    correlated_points: float = option(8.0, "", "neighbouring beams err together: so many count as one")


@dataclass(frozen=True, slots=True, eq=False)
class IcpResult:
    """`T_target_scan`, its (3, 3) `information` (x, y, theta of the target's axes; singular where nothing is seen).

    `inlier_ratio` is points within `inlier_m` of a line, over all points; `residual_m` their mean distance.
    """

    T_target_scan: Pose2
    information: Floats
    inlier_ratio: float
    residual_m: float


def icp(scan: ScanPoints, target: PointIndex, guess: Pose2, prior: Floats, config: IcpConfig) -> IcpResult:
    """Align `scan` to `target` from `guess` (T_target_scan), with `prior` information (3, 3) about it."""
    points = np.ascontiguousarray(scan.points)
    index = (
        target.points, target.normals, target.starts, target.origin, target.cell_m, target.rows, target.columns,
    )  # fmt: skip
    pose, information = _align(
        points, scan.normals, *index, guess.array(), prior, config.iterations, config.gate_start_m, config.gate_end_m,
        config.sigma_m, config.least_sigma_m, config.correlated_points,
        math.cos(config.max_turned_rad),
    )  # fmt: skip
    inliers, residual = _inliers(points, *index, pose, config.inlier_m)
    return IcpResult(Pose2.of(pose), information, inliers / max(len(points), 1), residual)


@njit(cache=True)
def _align(
    points: Floats,
    facing: Floats,
    target: Floats,
    normals: Floats,
    starts: NDArray[np.int64],
    origin: Floats,
    cell_m: float,
    rows: int,
    columns: int,
    guess: Floats,
    prior: Floats,
    iterations: int,
    gate_start_m: float,
    gate_end_m: float,
    sigma_m: float,
    least_sigma_m: float,
    correlated: float,
    least_cos: float,
) -> tuple[Floats, Floats]:
    pose = guess.copy()
    variance = sigma_m * sigma_m
    information = np.zeros((3, 3))
    for iteration in range(iterations):
        gate = max(gate_end_m, gate_start_m * 0.7**iteration)
        information[:] = 0.0
        gradient = np.zeros(3)
        weights, squares = 0.0, 0.0
        c, s = np.cos(pose[2]), np.sin(pose[2])
        for i in range(points.shape[0]):
            rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
            x, y = rx + pose[0], ry + pose[1]
            k = nearest(x, y, min(gate, cell_m), target, starts, origin, cell_m, rows, columns)
            if k < 0 or np.isnan(normals[k, 0]):
                continue
            nx, ny = normals[k, 0], normals[k, 1]
            fx, fy = c * facing[i, 0] - s * facing[i, 1], s * facing[i, 0] + c * facing[i, 1]
            if fx * nx + fy * ny < least_cos:
                continue
            error = nx * (x - target[k, 0]) + ny * (y - target[k, 1])
            scale = max(0.5 * gate, sigma_m)
            weight = 1.0 / (1.0 + (error / scale) ** 2)
            weights += weight
            squares += weight * error * error
            jt = nx * -ry + ny * rx
            J = (nx, ny, jt)
            for a in range(3):
                gradient[a] += weight * J[a] * error
                for b in range(3):
                    information[a, b] += weight * J[a] * J[b]
        if gate <= gate_end_m and weights > 0:
            variance = max(least_sigma_m * least_sigma_m, squares / weights)
        information /= variance * correlated
        gradient /= variance * correlated
        step = np.linalg.solve(information + prior + 1e-6 * np.eye(3), -gradient - prior @ (pose - guess))
        pose += step
        if gate <= gate_end_m and abs(step[0]) + abs(step[1]) < 1e-4 and abs(step[2]) < 1e-5:
            break
    return pose, information


@njit(cache=True)
def _inliers(
    points: Floats,
    target: Floats,
    normals: Floats,
    starts: NDArray[np.int64],
    origin: Floats,
    cell_m: float,
    rows: int,
    columns: int,
    pose: Floats,
    inlier_m: float,
) -> tuple[int, float]:
    """How many points lie within `inlier_m` of a line, and their mean distance."""
    inliers, total = 0, 0.0
    c, s = np.cos(pose[2]), np.sin(pose[2])
    for i in range(points.shape[0]):
        x = c * points[i, 0] - s * points[i, 1] + pose[0]
        y = s * points[i, 0] + c * points[i, 1] + pose[1]
        k = nearest(x, y, min(2 * inlier_m, cell_m), target, starts, origin, cell_m, rows, columns)
        if k < 0:
            continue
        error = np.hypot(x - target[k, 0], y - target[k, 1])
        if not np.isnan(normals[k, 0]):
            error = abs(normals[k, 0] * (x - target[k, 0]) + normals[k, 1] * (y - target[k, 1]))
        if error < inlier_m:
            inliers += 1
            total += error
    return inliers, total / max(inliers, 1)
