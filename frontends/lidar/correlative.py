"""Where does a scan fit a submap? A search of a whole window of poses on a likelihood field, coarse to fine.

Correlative scan matching after Olson (ICRA 2009), with the branch and bound of Hess et al. (Cartographer, ICRA 2016): a
coarse cell's score is an upper bound of what any pose in it can reach. Bounded by the poses examined, never by time.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats, Pose2

BRANCH = 4  # fine cells along the side of a coarse one


@dataclass(frozen=True)
class CorrelativeConfig:
    """Bounds of one search."""

    cell_m: float = option(0.1, "m", "a scan's noise and the spacing of far beams; ICP refines to the centimetre")
    angle_step: float = option(0.015, "rad", "0.15 m at 10 m, which the field's blur covers")
    blur_m: float = option(0.12, "m", "how far a point may lie from a wall and still speak for it")
    points: int = option(200, "", "more points change the peak's place by less than a cell")
    max_coarse_cells: int = option(600, "", "coarse cells opened before the search ends: bounds its cost")
    peak_apart_m: float = option(0.6, "m", "nearer than this, two poses are one peak")
    peak_apart_rad: float = option(0.2, "rad", "as above")


@dataclass(frozen=True, slots=True, eq=False)
class LikelihoodField:
    """`fine` (rows, columns) float32 in [0, 1]: how well a point there agrees with the submap; `coarse` bounds it.

    `coarse[r, c]` is the greatest value of `fine[r : r + BRANCH, c : c + BRANCH]`, at every fine cell.
    """

    fine: NDArray[np.float32]
    coarse: NDArray[np.float32]
    origin: Floats
    cell_m: float


@dataclass(frozen=True, slots=True, eq=False)
class SearchWindow:
    """The poses to examine: within `xy_m` and `theta_rad` of the guess, and within `chi2` of it by `information`.

    The information (3, 3) is about (x, y, theta) in the axes of the submap; zeros leave the whole box.
    """

    xy_m: float
    theta_rad: float
    information: Floats
    chi2: float

    @classmethod
    def of(
        cls, covariance: Floats, chi2: float, least: tuple[float, float], most: tuple[float, float]
    ) -> "SearchWindow":
        """The ellipse of `chi2` of a (3, 3) covariance, in a box between `least` and `most` (m, rad)."""
        sigma_m, sigma_rad = math.sqrt(max(covariance[0, 0], covariance[1, 1])), math.sqrt(covariance[2, 2])
        reach = math.sqrt(chi2)
        widened = covariance + np.diag([least[0] ** 2, least[0] ** 2, least[1] ** 2]) / chi2
        return cls(
            min(max(reach * sigma_m, least[0]), most[0]),
            min(max(reach * sigma_rad, least[1]), most[1]),
            np.ascontiguousarray(np.linalg.inv(widened)),
            chi2,
        )


@dataclass(frozen=True, slots=True)
class Peak:
    """The best pose found, its score in [0, 1], and the score of the best pose elsewhere in the window."""

    pose: Pose2
    score: float
    second_score: float


def build_field(points: Floats, config: CorrelativeConfig) -> LikelihoodField:
    """The likelihood field of a submap's `points` (n >= 1, 2) m."""
    reach = math.ceil(3 * config.blur_m / config.cell_m)
    low = points.min(axis=0) - (reach + 1) * config.cell_m
    rows, columns = (int(n) + reach + 2 for n in (points.max(axis=0) - low) / config.cell_m)
    fine = _splat(points, low, config.cell_m, rows, columns, reach, config.blur_m)
    return LikelihoodField(fine, _pool(fine), low, config.cell_m)


def search(
    points: Floats, field: LikelihoodField, guess: Pose2, window: SearchWindow, config: CorrelativeConfig
) -> Peak:
    """The T_submap_scan in the `window` around `guess` that `points` (n, 2) fit best."""
    subset = points[:: max(1, len(points) // config.points)]
    half_angles = math.ceil(window.theta_rad / config.angle_step)
    angles = guess.theta + config.angle_step * np.arange(-half_angles, half_angles + 1, dtype=np.float64)
    half_cells = math.ceil(window.xy_m / config.cell_m)
    x, y, theta, score, second = _search(
        np.ascontiguousarray(subset),
        field.fine,
        field.coarse,
        field.origin,
        field.cell_m,
        guess.x,
        guess.y,
        angles,
        half_cells,
        window.information,
        window.chi2,
        config.max_coarse_cells,
        config.peak_apart_m,
        config.peak_apart_rad,
    )
    return Peak(Pose2.of((x, y, theta)), score, second)


@njit(cache=True)
def _splat(
    points: Floats, origin: Floats, cell_m: float, rows: int, columns: int, reach: int, blur_m: float
) -> NDArray[np.float32]:
    side = 2 * reach + 1
    kernel = np.empty((side, side), np.float32)
    for r in range(side):
        for c in range(side):
            d2 = ((r - reach) ** 2 + (c - reach) ** 2) * cell_m * cell_m
            kernel[r, c] = np.exp(-0.5 * d2 / (blur_m * blur_m))
    field = np.zeros((rows, columns), np.float32)
    for i in range(points.shape[0]):
        r0, c0 = int((points[i, 0] - origin[0]) / cell_m), int((points[i, 1] - origin[1]) / cell_m)
        if field[r0, c0] == 1.0:
            continue
        for r in range(max(r0 - reach, 0), min(r0 + reach + 1, rows)):
            for c in range(max(c0 - reach, 0), min(c0 + reach + 1, columns)):
                field[r, c] = max(field[r, c], kernel[r - r0 + reach, c - c0 + reach])
    return field


@njit(cache=True)
def _pool(fine: NDArray[np.float32]) -> NDArray[np.float32]:
    rows, columns = fine.shape
    along = np.zeros_like(fine)
    for r in range(rows):
        for c in range(columns):
            best = np.float32(0)
            for k in range(c, min(c + BRANCH, columns)):
                best = max(best, fine[r, k])
            along[r, c] = best
    pooled = np.zeros_like(fine)
    for r in range(rows):
        for c in range(columns):
            best = np.float32(0)
            for k in range(r, min(r + BRANCH, rows)):
                best = max(best, along[k, c])
            pooled[r, c] = best
    return pooled


@njit(cache=True)
def _score(cells: NDArray[np.int64], field: NDArray[np.float32], dr: int, dc: int) -> float:
    rows, columns = field.shape
    total = 0.0
    for i in range(cells.shape[0]):
        r, c = cells[i, 0] + dr, cells[i, 1] + dc
        if 0 <= r < rows and 0 <= c < columns:
            total += field[r, c]
    mean: float = total / cells.shape[0]
    return mean


@njit(cache=True)
def _bound(cells: NDArray[np.int64], coarse: NDArray[np.float32], dr: int, dc: int) -> float:
    rows, columns = coarse.shape
    total = 0.0
    for i in range(cells.shape[0]):
        r, c = cells[i, 0] + dr, cells[i, 1] + dc
        if -BRANCH < r < rows and -BRANCH < c < columns:
            total += coarse[max(r, 0), max(c, 0)]
    mean: float = total / cells.shape[0]
    return mean


@njit(cache=True)
def _chi2(dx: float, dy: float, dtheta: float, information: Floats) -> float:
    squares = information[0, 0] * dx * dx + information[1, 1] * dy * dy + information[2, 2] * dtheta * dtheta
    products = information[0, 1] * dx * dy + (information[0, 2] * dx + information[1, 2] * dy) * dtheta
    total: float = squares + 2 * products
    return total


@njit(cache=True)
def _reaches(row: int, column: int, cell_m: float, dtheta: float, information: Floats, chi2: float) -> bool:
    """Whether any pose in the coarse cell at `row`, `column` lies within `chi2`."""
    for dr in range(row, row + BRANCH):
        for dc in range(column, column + BRANCH):
            if _chi2(dr * cell_m, dc * cell_m, dtheta, information) <= chi2:
                return True
    return False


@njit(cache=True)
def _search(
    points: Floats,
    fine: NDArray[np.float32],
    coarse: NDArray[np.float32],
    origin: Floats,
    cell_m: float,
    x0: float,
    y0: float,
    angles: Floats,
    half_cells: int,
    information: Floats,
    chi2: float,
    max_coarse_cells: int,
    apart_m: float,
    apart_rad: float,
) -> tuple[float, float, float, float, float]:
    n, n_angles = points.shape[0], angles.shape[0]
    cells = np.empty((n_angles, n, 2), np.int64)
    for a in range(n_angles):
        c, s = np.cos(angles[a]), np.sin(angles[a])
        for i in range(n):
            cells[a, i, 0] = int(np.floor((c * points[i, 0] - s * points[i, 1] + x0 - origin[0]) / cell_m))
            cells[a, i, 1] = int(np.floor((s * points[i, 0] + c * points[i, 1] + y0 - origin[1]) / cell_m))
    offsets = np.arange(-half_cells, half_cells + 1, BRANCH)
    side = offsets.shape[0]
    bounds = np.zeros(n_angles * side * side)
    middle = angles[n_angles // 2]
    for a in range(n_angles):
        for i in range(side):
            for j in range(side):
                if _reaches(offsets[i], offsets[j], cell_m, angles[a] - middle, information, chi2):
                    bounds[(a * side + i) * side + j] = _bound(cells[a], coarse, offsets[i], offsets[j])
    order = np.argsort(-bounds, kind="mergesort")
    best = (n_angles // 2, 0, 0)
    best_score, second = 0.0, 0.0
    for k in range(min(max_coarse_cells, order.shape[0])):
        if bounds[order[k]] <= second:
            break
        a, rest = order[k] // (side * side), order[k] % (side * side)
        for dr in range(offsets[rest // side], offsets[rest // side] + BRANCH):
            for dc in range(offsets[rest % side], offsets[rest % side] + BRANCH):
                if _chi2(dr * cell_m, dc * cell_m, angles[a] - middle, information) > chi2:
                    continue
                score = _score(cells[a], fine, dr, dc)
                near = (
                    np.hypot(dr - best[1], dc - best[2]) * cell_m < apart_m
                    and abs(angles[a] - angles[best[0]]) < apart_rad
                )
                if score > best_score:
                    if not near:
                        second = max(second, best_score)
                    best, best_score = (a, dr, dc), score
                elif not near:
                    second = max(second, score)
    return x0 + best[1] * cell_m, y0 + best[2] * cell_m, angles[best[0]], best_score, second
