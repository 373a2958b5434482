"""Correlative scan matching: a search of a whole window of poses on a likelihood field, coarse to fine.

After Olson, "Real-time correlative scan matching" (ICRA 2009), with the branch and bound of Hess et al. (Cartographer,
ICRA 2016): the score of a coarse cell is an upper bound of the score of any pose in it. The cost is bounded by the
number of poses examined, never by time.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats, Pose2, diagonal_covariance

BRANCH = 4  # fine cells along a coarse one: decides the time, and by how many cells the window is rounded up

BLUR_SIGMAS = 3  # of a point's Gaussian, which ends there: at 0.01 of its peak


@dataclass(frozen=True)
class CorrelativeConfig:
    """Bounds of one search."""

    cell_m: float = option(0.1, "m", "a scan's noise and the spacing of far beams; ICP refines to the centimetre")
    angle_step: float = option(0.015, "rad", "0.15 m at 10 m, which the field's blur covers")
    blur_m: float = option(0.12, "m", "how far a point may lie from a wall and still support it")
    points: int = option(200, "", "and up to twice as many: more change the peak's place by less than a cell")
    max_coarse_cells: int = option(600, "", "coarse cells opened before the search ends: bounds its cost")
    peak_apart_m: float = option(0.6, "m", "nearer than this, two poses are one peak")
    peak_apart_rad: float = option(0.2, "rad", "as above")


class LikelihoodField(NamedTuple):
    """`fine` (rows, columns) float32 in [0, 1]: the likelihood of a point in each cell of side `cell_m`.

    `coarse[r, c]` is the greatest value of `fine[r : r + BRANCH, c : c + BRANCH]`, for every fine cell. The lower
    corner of cell (0, 0) is `origin` (2,) m; rows run along x.
    """

    fine: NDArray[np.float32]
    coarse: NDArray[np.float32]
    origin: Floats
    cell_m: float


class SearchWindow(NamedTuple):
    """The poses to examine: within `xy_m` and `theta_rad` of the guess, and within `chi2` of it by `information`.

    The information (3, 3) is about (x, y, theta) in the axes of the submap; zeros leave the whole box.
    """

    xy_m: float
    theta_rad: float
    information: Floats
    chi2: float

    @classmethod
    def of(
        cls, covariance: Floats, chi2: float, smallest: tuple[float, float], largest: tuple[float, float]
    ) -> "SearchWindow":
        """The ellipse of `chi2` of a (3, 3) covariance, in a box between `smallest` and `largest` (m, rad)."""
        sigma_m, sigma_rad = math.sqrt(max(covariance[0, 0], covariance[1, 1])), math.sqrt(covariance[2, 2])
        reach = math.sqrt(chi2)
        widened = covariance + diagonal_covariance(*smallest) / chi2
        return cls(
            min(max(reach * sigma_m, smallest[0]), largest[0]),
            min(max(reach * sigma_rad, smallest[1]), largest[1]),
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
    """The likelihood field of a submap's `points` (n >= 1, 2) m: a Gaussian of `blur_m` around each of them."""
    reach = math.ceil(BLUR_SIGMAS * config.blur_m / config.cell_m)
    low = points.min(axis=0) - (reach + 1) * config.cell_m
    rows, columns = (int(n) + reach + 2 for n in (points.max(axis=0) - low) / config.cell_m)
    fine = _blur(points, low, config.cell_m, rows, columns, reach, config.blur_m)
    return LikelihoodField(fine, max_pooled(fine), low, config.cell_m)


def search(
    points: Floats, field: LikelihoodField, guess: Pose2, window: SearchWindow, config: CorrelativeConfig
) -> Peak:
    """The T_submap_scan in the `window` around `guess` that `points` (n, 2) m fit best."""
    subset = np.ascontiguousarray(points[:: max(1, len(points) // config.points)])
    half_angles = math.ceil(window.theta_rad / config.angle_step)
    angles = guess.theta + config.angle_step * np.arange(-half_angles, half_angles + 1, dtype=np.float64)
    half_cells = math.ceil(window.xy_m / config.cell_m)
    corners = np.arange(-half_cells, half_cells + 1, BRANCH)
    row, column, angle, score, second = _search(
        subset, field, guess.x, guess.y, angles, corners, window,
        config.max_coarse_cells, config.peak_apart_m, config.peak_apart_rad,
    )  # fmt: skip
    pose = Pose2.of((guess.x + row * field.cell_m, guess.y + column * field.cell_m, angles[angle]))
    return Peak(pose, score, second)


@njit(cache=True)
def _search(
    points: Floats, field: LikelihoodField, x: float, y: float, angles: Floats, corners: NDArray[np.int64],
    window: SearchWindow, max_coarse_cells: int, apart_m: float, apart_rad: float,
) -> tuple[int, int, int, float, float]:  # fmt: skip
    """What `_best_poses` gives, of the coarse cells from `corners` on at each of the angles (rad), best bounds first.

    Rows and columns count from the guess x, y (m); the window's ellipse is around it and the middle angle.
    """
    cells = _cells_at(points, field, x, y, angles)
    bounds = _upper_bounds(cells, field, angles, corners, window)
    order = _greatest(bounds.ravel(), max_coarse_cells)
    return _best_poses(cells, field, angles, corners, window, bounds, order, apart_m, apart_rad)


@njit(cache=True)
def _greatest(values: Floats, most: int) -> NDArray[np.int64]:
    """Where the `most` greatest values (n,) are, the greatest first, equal ones in their order."""
    rest = max(len(values) - most, 0)
    candidates = np.flatnonzero(values >= np.partition(values, rest)[rest])
    return candidates[np.argsort(-values[candidates], kind="mergesort")[:most]]


@njit(cache=True)
def _blur(
    points: Floats, origin: Floats, cell_m: float, rows: int, columns: int, reach: int, blur_m: float
) -> NDArray[np.float32]:
    """(rows, columns) the Gaussian of the nearest point, up to `reach` cells from it; 1 in the cells of the points."""
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
def max_pooled(fine: NDArray[np.float32]) -> NDArray[np.float32]:
    """(rows, columns) the greatest value of the BRANCH x BRANCH cells from each cell on, by rows, then by columns."""
    rows, columns = fine.shape
    along = np.zeros_like(fine)
    for r in range(rows):
        for c in range(columns):
            for k in range(c, min(c + BRANCH, columns)):
                along[r, c] = max(along[r, c], fine[r, k])
    pooled = np.zeros_like(fine)
    for r in range(rows):
        for c in range(columns):
            for k in range(r, min(r + BRANCH, rows)):
                pooled[r, c] = max(pooled[r, c], along[k, c])
    return pooled


@njit(cache=True)
def _cells_at(points: Floats, field: LikelihoodField, x: float, y: float, angles: Floats) -> NDArray[np.int64]:
    """(angles, n, 2) row and column of each point where the scan's pose is x, y (m) and each of the angles."""
    cells = np.empty((angles.shape[0], points.shape[0], 2), np.int64)
    for a in range(angles.shape[0]):
        c, s = np.cos(angles[a]), np.sin(angles[a])
        for i in range(points.shape[0]):
            placed_x = c * points[i, 0] - s * points[i, 1] + x
            placed_y = s * points[i, 0] + c * points[i, 1] + y
            cells[a, i, 0] = int(np.floor((placed_x - field.origin[0]) / field.cell_m))
            cells[a, i, 1] = int(np.floor((placed_y - field.origin[1]) / field.cell_m))
    return cells


@njit(cache=True)
def mean_values(
    cells: NDArray[np.int64], values: NDArray[np.float32], dr: int, moved: NDArray[np.int64], overhang: int
) -> Floats:
    """(m,) means of `values` (rows, columns) at `cells` (n, 2) moved by `dr` and each of `moved`; beyond the edges 0.

    Up to `overhang` cells before the first row or column the first one's value holds: with 0 these are the scores of
    poses in the fine field, with BRANCH - 1 the bounds of coarse cells' scores in the coarse field. The sums grow side
    by side, since each addition waits for the one before.
    """
    rows, columns = values.shape
    sums = np.zeros(moved.shape[0])
    for k in range(cells.shape[0]):
        r, c = cells[k, 0] + dr, cells[k, 1]
        if -overhang <= r < rows:
            row = values[max(r, 0)]
            for j in range(moved.shape[0]):
                if -overhang <= c + moved[j] < columns:
                    sums[j] += row[max(c + moved[j], 0)]
    return np.asarray(sums / cells.shape[0])


@njit(cache=True)
def _chi2(dx: float, dy: float, dtheta: float, information: Floats) -> float:
    squares = information[0, 0] * dx * dx + information[1, 1] * dy * dy + information[2, 2] * dtheta * dtheta
    products = information[0, 1] * dx * dy + (information[0, 2] * dx + information[1, 2] * dy) * dtheta
    total: float = squares + 2 * products
    return total


@njit(cache=True)
def _meets_window(row: int, column: int, cell_m: float, dtheta: float, window: SearchWindow) -> bool:
    """Whether any pose in the coarse cell from `row`, `column` on lies within the window's chi2."""
    for dr in range(row, row + BRANCH):
        for dc in range(column, column + BRANCH):
            if _chi2(dr * cell_m, dc * cell_m, dtheta, window.information) <= window.chi2:
                return True
    return False


@njit(cache=True)
def _upper_bounds(
    cells: NDArray[np.int64], field: LikelihoodField, angles: Floats, corners: NDArray[np.int64], window: SearchWindow
) -> Floats:
    """(angles, side, side) bound of the scores in each coarse cell, from `corners` (side,) on; 0 out of the window."""
    side, middle = corners.shape[0], angles[angles.shape[0] // 2]
    bounds = np.zeros((angles.shape[0], side, side))
    for a in range(angles.shape[0]):
        for i in range(side):
            means = mean_values(cells[a], field.coarse, corners[i], corners, BRANCH - 1)
            for j in range(side):
                if _meets_window(corners[i], corners[j], field.cell_m, angles[a] - middle, window):
                    bounds[a, i, j] = means[j]
    return bounds


@njit(cache=True)
def _best_poses(
    cells: NDArray[np.int64], field: LikelihoodField, angles: Floats, corners: NDArray[np.int64],
    window: SearchWindow, bounds: Floats, order: NDArray[np.int64], apart_m: float, apart_rad: float,
) -> tuple[int, int, int, float, float]:  # fmt: skip
    """Row, column and angle of the best pose, its score, and the score of the best one that is apart from it.

    Opens the coarse cells in `order`, until no bound is above the second score.
    """
    side, middle = corners.shape[0], angles[angles.shape[0] // 2]
    best = (0, 0, angles.shape[0] // 2)
    best_score, second = 0.0, 0.0
    for k in order:
        a, i, j = k // (side * side), k // side % side, k % side
        if bounds[a, i, j] <= second:
            break
        columns = np.arange(corners[j], corners[j] + BRANCH)
        for dr in range(corners[i], corners[i] + BRANCH):
            means = mean_values(cells[a], field.fine, dr, columns, 0)
            for dc in columns:
                if _chi2(dr * field.cell_m, dc * field.cell_m, angles[a] - middle, window.information) > window.chi2:
                    continue
                score = means[dc - columns[0]]
                off_m = np.hypot(dr - best[0], dc - best[1]) * field.cell_m
                turned = abs(angles[a] - angles[best[2]])
                near = off_m < apart_m and min(turned, 2 * np.pi - turned) < apart_rad
                if score > best_score:
                    if not near:
                        second = max(second, best_score)
                    best, best_score = (dr, dc, a), score
                elif not near:
                    second = max(second, score)
    return best[0], best[1], best[2], best_score, second
