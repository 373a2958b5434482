"""Point-to-line ICP in the plane, with the motion model as a prior and a covariance from its Hessian.

Point-to-line after Censi, "An ICP variant using a point-to-line metric" (ICRA 2008), with a Cauchy kernel that narrows
with the gate. Once it is narrow, a point beyond the end of what the target has seen of a wall is compared with nothing
(Turk and Levoy, "Zippered polygon meshes from range images", SIGGRAPH 1994): in a corridor the lines that end there
pull the pose back. Before, the guess may be further off than points are apart, so that no end can be told. Along a
direction that the walls do not constrain, the pose stays where the prior puts it, and the information of the result is
zero.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.point_index import PointIndex, nearest
from wayfi.frontends.scan_points import ScanPoints

SETTLED_M, SETTLED_RAD = 1e-4, 1e-5  # a hundredth of the least sigma of a point, here and at 10 m: steps end below it
DAMPING = 1e-6  # 1/m^2, 1/rad^2: keeps the equations solvable where neither walls nor a prior hold a direction


@dataclass(frozen=True)
class IcpConfig:
    """Bounds and weights of one ICP."""

    iterations: int = option(20, "", "the first guess is within 0.3 m; it settles in 6 to 12")
    gate_start_m: float = option(0.8, "m", "how far the first guess may be off")
    gate_end_m: float = option(0.2, "m", "wider takes in furniture that is not in the submap")
    gate_factor: float = option(0.7, "", "of the gate, each iteration: it is at its end after four")
    kernel_share: float = option(
        0.5, "", "of the gate is the scale of the Cauchy kernel: at the gate the weight is 0.2"
    )
    inlier_m: float = option(0.12, "m", "three times a laser's noise plus the spacing of the points")
    sigma_m: float = option(0.03, "m", "noise of a range and of the wall that it is compared with, at the first guess")
    least_sigma_m: float = option(0.01, "m", "the noise is estimated from the residuals; a good laser's is no less")
    max_turned_rad: float = option(0.8, "rad", "between a point's normal and its wall's; beyond, it is another face")
    extent_m: float = option(
        0.06, "m", "of wall on each side of a point: as far as thinned points are apart, where beams are not further"
    )
    correlated_points: float = option(8.0, "1", "neighbouring beams err together: so many count as one")


@dataclass(frozen=True, slots=True, eq=False)
class IcpResult:
    """`T_target_scan`, its (3, 3) `information` (x, y, theta in the target's axes; singular along open directions).

    `inlier_ratio` is the share of points within `inlier_m` of a line, `residual_m` the mean distance of these.
    """

    T_target_scan: Pose2
    information: Floats
    inlier_ratio: float
    residual_m: float


class _IcpParams(NamedTuple):
    """IcpConfig as compiled code takes it; `min_cos` is the cosine of `max_turned_rad`."""

    iterations: int
    gate_start_m: float
    gate_end_m: float
    gate_factor: float
    kernel_share: float
    inlier_m: float
    sigma_m: float
    least_sigma_m: float
    extent_m: float
    correlated_points: float
    min_cos: float

    @classmethod
    def of(cls, config: IcpConfig) -> "_IcpParams":
        return cls(
            config.iterations, config.gate_start_m, config.gate_end_m, config.gate_factor, config.kernel_share,
            config.inlier_m, config.sigma_m, config.least_sigma_m, config.extent_m, config.correlated_points,
            math.cos(config.max_turned_rad),
        )  # fmt: skip


def icp(scan: ScanPoints, target: PointIndex, guess: Pose2, prior: Floats, config: IcpConfig) -> IcpResult:
    """Align `scan` to `target` from `guess` (T_target_scan), with `prior` information (3, 3) about the guess."""
    points = np.ascontiguousarray(scan.points)
    pose, information, inliers, residual_m = _align(
        points, scan.normals, target, guess.array(), prior, _IcpParams.of(config)
    )
    return IcpResult(Pose2.of(pose), information, inliers / max(len(points), 1), residual_m)


def inlier_ratio(scan: ScanPoints, target: PointIndex, T_target_scan: Pose2, config: IcpConfig) -> float:
    """The inlier ratio of a scan at a given pose."""
    points = np.ascontiguousarray(scan.points)
    inliers, _ = _inliers(points, scan.normals, target, T_target_scan.array(), _IcpParams.of(config))
    return inliers / max(len(points), 1)


@njit(cache=True)
def _align(
    points: Floats, normals: Floats, target: PointIndex, guess: Floats, prior: Floats, params: _IcpParams
) -> tuple[Floats, Floats, int, float]:
    """T_target_scan (3,) by Gauss-Newton steps with a gate that narrows, and the points' information (3, 3) there.

    Also the number of inliers and their mean distance (m).
    """
    pose = guess.copy()
    variance = params.sigma_m * params.sigma_m
    information = np.zeros((3, 3))
    extents_m, anywhere_m = _extents_m(points, params.extent_m), np.full(points.shape[0], np.inf)
    for iteration in range(params.iterations):
        gate_m = max(params.gate_end_m, params.gate_start_m * params.gate_factor**iteration)
        narrow = gate_m <= params.gate_end_m
        information, gradient, weights, squares = _normal_equations(
            points, normals, extents_m if narrow else anywhere_m, target, pose, gate_m, params
        )
        if narrow and weights > 0:
            variance = max(params.least_sigma_m * params.least_sigma_m, squares / weights)
        information /= variance * params.correlated_points
        gradient /= variance * params.correlated_points
        damped = information + prior + DAMPING * np.eye(3)
        step = np.linalg.solve(damped, -gradient - prior @ (pose - guess))
        pose += step
        if narrow and abs(step[0]) + abs(step[1]) < SETTLED_M and abs(step[2]) < SETTLED_RAD:
            break
    inliers, residual_m = _inliers(points, normals, target, pose, params)
    return pose, information, inliers, residual_m


@njit(cache=True)
def _extents_m(points: Floats, least_m: float) -> Floats:
    """(n,) how far (m) along its wall a point may be from the one that it is compared with.

    That is the spacing of the points there. A submap of several scans is denser; what is further off is beyond its end.
    """
    n = points.shape[0]
    extents_m = np.full(n, least_m)
    for i in range(n):
        spacing_m = np.inf
        for j in (i - 1, i + 1):
            if 0 <= j < n:
                spacing_m = min(spacing_m, np.hypot(points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]))
        if spacing_m < np.inf:
            extents_m[i] = max(least_m, spacing_m)
    return extents_m


@njit(cache=True)
def _normal_equations(
    points: Floats,
    normals: Floats,
    extents_m: Floats,
    target: PointIndex,
    pose: Floats,
    gate_m: float,
    params: _IcpParams,
) -> tuple[Floats, Floats, float, float]:
    """Sums over the correspondences: w J J' (3, 3), w J e (3,), w and w e^2 of their weights w and residuals e (m)."""
    hessian, gradient = np.zeros((3, 3)), np.zeros(3)
    weights, squares = 0.0, 0.0
    walls, wall_normals, cells = target.points, target.normals, target.cells
    scale_m = max(params.kernel_share * gate_m, params.sigma_m)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    for i in range(points.shape[0]):
        if np.isnan(normals[i, 0]):
            continue  # a point without a normal would bias the pose
        rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        x, y = rx + pose[0], ry + pose[1]
        k = nearest(x, y, min(gate_m, cells.cell_m), walls, cells)
        if k < 0 or np.isnan(wall_normals[k, 0]):
            continue
        nx, ny = wall_normals[k, 0], wall_normals[k, 1]
        turned_x, turned_y = c * normals[i, 0] - s * normals[i, 1], s * normals[i, 0] + c * normals[i, 1]
        if not turned_x * nx + turned_y * ny >= params.min_cos:
            continue  # another face
        dx, dy = x - walls[k, 0], y - walls[k, 1]
        if abs(nx * dy - ny * dx) > extents_m[i]:
            continue  # beyond the end of what was seen of the wall
        error = nx * dx + ny * dy
        weight = 1.0 / (1.0 + (error / scale_m) ** 2)
        weights += weight
        squares += weight * error * error
        J = (nx, ny, nx * -ry + ny * rx)
        for a in range(3):
            gradient[a] += weight * J[a] * error
            for b in range(3):
                hessian[a, b] += weight * J[a] * J[b]
    return hessian, gradient, weights, squares


@njit(cache=True)
def _inliers(
    points: Floats, normals: Floats, target: PointIndex, pose: Floats, params: _IcpParams
) -> tuple[int, float]:
    """How many points lie within `inlier_m` of a line that faces as theirs does, and their mean distance to it (m).

    Where one of the two has no normal, the distance is that of the points.
    """
    inliers, total_m = 0, 0.0
    gate_m = min(2 * params.inlier_m, target.cells.cell_m)  # the nearest point lies further off than its line
    c, s = np.cos(pose[2]), np.sin(pose[2])
    for i in range(points.shape[0]):
        x = c * points[i, 0] - s * points[i, 1] + pose[0]
        y = s * points[i, 0] + c * points[i, 1] + pose[1]
        k = nearest(x, y, gate_m, target.points, target.cells)
        if k < 0:
            continue
        dx, dy = x - target.points[k, 0], y - target.points[k, 1]
        error_m = np.hypot(dx, dy)
        if not np.isnan(target.normals[k, 0]):
            turned_x, turned_y = c * normals[i, 0] - s * normals[i, 1], s * normals[i, 0] + c * normals[i, 1]
            if turned_x * target.normals[k, 0] + turned_y * target.normals[k, 1] < params.min_cos:
                continue
            error_m = abs(target.normals[k, 0] * dx + target.normals[k, 1] * dy)
        if error_m < params.inlier_m:
            inliers += 1
            total_m += error_m
    return inliers, total_m / max(inliers, 1)
