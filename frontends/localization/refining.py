"""Refines a pose that fits by whole cells to centimetres: a pattern search on the finest likelihood field."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.localization.place_field import FULL, PARTS, PlaceField

STEP_M, STEP_RAD = 0.1, 0.01  # half of the steps of the poses compared before
WIDTH = 2  # steps to each side that are compared first
SHARE = 3  # of the points every third is compared at first
HALVINGS = 2  # of the steps, to 2.5 cm and 2.5 mrad
MOVES = 10  # with steps of one size: a pose that goes on beyond them is found from elsewhere as well
POSES = 600  # of the others, whose comparison takes as long as refining one


@njit(cache=True)
def refined(points: Floats, field: PlaceField, poses: Floats) -> Floats:
    """(m, 4) the poses near to each of `poses` (m, 3) that `points` (n, 2) m fit best, and their scores, 0 to 1."""
    few, found = np.ascontiguousarray(points[::SHARE]), np.empty((poses.shape[0], 4))
    for k in range(poses.shape[0]):
        best, _ = _best_around(few, field, poses[k], STEP_M, STEP_RAD, WIDTH)
        found[k, :3], found[k, 3] = _climbed(points, field, best)
    return found


@njit(cache=True)
def _climbed(points: Floats, field: PlaceField, best: Floats) -> tuple[Floats, float]:
    """The pose that steps to better ones lead to from `best`, with ever smaller steps, and its score."""
    score = _score(points, field.fine, field.origin, field.cell_m / PARTS, best)
    step_m, step_rad = STEP_M, STEP_RAD
    for _ in range(HALVINGS):
        step_m, step_rad = 0.5 * step_m, 0.5 * step_rad
        for _ in range(MOVES):
            moved, moved_score = _best_around(points, field, best, step_m, step_rad, 1)
            if moved_score <= score:
                break
            best, score = moved, moved_score
    return best, score


@njit(cache=True)
def _best_around(
    points: Floats, field: PlaceField, pose: Floats, step_m: float, step_rad: float, width: int
) -> tuple[Floats, float]:
    """The best of the poses up to `width` steps away along each axis, and its score; `pose` if none is better."""
    best, score = pose.copy(), _score(points, field.fine, field.origin, field.cell_m / PARTS, pose)
    for a in range(-width, width + 1):
        for i in range(-width, width + 1):
            for j in range(-width, width + 1):
                tried = pose + np.array([i * step_m, j * step_m, a * step_rad])
                tried_score = _score(points, field.fine, field.origin, field.cell_m / PARTS, tried)
                if tried_score > score:
                    best, score = tried, tried_score
    return best, score


@njit(cache=True)
def _score(points: Floats, fine: NDArray[np.uint8], origin: Floats, cell_m: float, pose: Floats) -> float:
    c, s = np.cos(pose[2]) / cell_m, np.sin(pose[2]) / cell_m
    x, y = (pose[0] - origin[0]) / cell_m, (pose[1] - origin[1]) / cell_m
    total = 0
    for i in range(points.shape[0]):
        row = c * points[i, 0] - s * points[i, 1] + x
        column = s * points[i, 0] + c * points[i, 1] + y
        if 0 <= row < fine.shape[0] and 0 <= column < fine.shape[1]:
            total += fine[int(row), int(column)]
    share: float = total / (FULL * points.shape[0])
    return share
