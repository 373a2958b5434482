"""Branch and bound over all poses of a map: blocks of poses wait by the bounds of their scores, the best first.

After Hess et al., "Real-time loop closure in 2D LIDAR SLAM" (ICRA 2016), section V-B. A block is one integer: the
greater it is, the sooner it is divided.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.localization.place_field import FULL, PlaceField

SCORE_STEPS = 32767  # of a score from 0 to 1, in the block's highest bits
CELL_BITS = 16  # rows and columns of the field: up to 13 km
ANGLE_BITS = 12
LEVEL_BITS = 3
LEVEL_SHIFT = 2 * CELL_BITS + ANGLE_BITS
SCORE_SHIFT = LEVEL_SHIFT + LEVEL_BITS

APART_CELLS, APART_ANGLES = 2, 4  # of two poses that are found: refining leads from one to the next

Ints = NDArray[np.int64]


class Block(NamedTuple):
    """The poses of 2**level x 2**level cells from (row, column) on at one angle; `score` is a bound, 0 to 1."""

    score: float
    level: int
    row: int
    column: int
    angle: int


@njit(cache=True, inline="always")
def packed(score: float, level: int, row: int, column: int, angle: int) -> int:
    """The block as an integer; of equal bounds the smallest block is the greatest."""
    steps = int(np.ceil(score * SCORE_STEPS))
    finest = (1 << LEVEL_BITS) - 1 - level
    place = (row << (CELL_BITS + ANGLE_BITS)) | (column << ANGLE_BITS) | angle
    return (steps << SCORE_SHIFT) | (finest << LEVEL_SHIFT) | place


@njit(cache=True, inline="always")
def unpacked(block: int) -> Block:
    """The block of an integer."""
    level = (1 << LEVEL_BITS) - 1 - ((block >> LEVEL_SHIFT) & ((1 << LEVEL_BITS) - 1))
    row, column = (
        (block >> (CELL_BITS + ANGLE_BITS)) & ((1 << CELL_BITS) - 1),
        (block >> ANGLE_BITS) & ((1 << CELL_BITS) - 1),
    )
    return Block((block >> SCORE_SHIFT) / SCORE_STEPS, level, row, column, block & ((1 << ANGLE_BITS) - 1))


@njit(cache=True)
def cells_at(points: Floats, angles: Floats, cell_m: float) -> NDArray[np.int32]:
    """(angles, n, 2) by how many rows and columns each point is away from the middle of the robot's cell."""
    cells = np.empty((angles.shape[0], points.shape[0], 2), np.int32)
    for a in range(angles.shape[0]):
        c, s = np.cos(angles[a]), np.sin(angles[a])
        for i in range(points.shape[0]):
            cells[a, i, 0] = int(np.floor((c * points[i, 0] - s * points[i, 1]) / cell_m + 0.5))
            cells[a, i, 1] = int(np.floor((s * points[i, 0] + c * points[i, 1]) / cell_m + 0.5))
    return cells


@njit(cache=True)
def bound(cells: NDArray[np.int32], field: PlaceField, level: int, row: int, column: int) -> float:
    """The greatest score that a pose of the block can have, for points at `cells` (n, 2) from the robot's."""
    pooled, overhang = field.pooled[level], (1 << level) - 1
    rows, columns = pooled.shape
    total = 0
    for i in range(cells.shape[0]):
        r, c = cells[i, 0] + row + overhang, cells[i, 1] + column + overhang
        if 0 <= r < rows and 0 <= c < columns:
            total += pooled[r, c]
    share: float = total / (FULL * cells.shape[0])
    return share


@njit(cache=True)
def push(waiting: Ints, count: int, block: int) -> int:
    """Add a block to the heap of the first `count` of those `waiting`; returns their new count."""
    k = count
    while k > 0 and waiting[(k - 1) // 2] < block:
        waiting[k] = waiting[(k - 1) // 2]
        k = (k - 1) // 2
    waiting[k] = block
    return count + 1


@njit(cache=True)
def pop(waiting: Ints, count: int) -> int:
    """Take the greatest block, `waiting[0]`, from the heap; returns the new count."""
    last, count, k = waiting[count - 1], count - 1, 0
    while 2 * k + 1 < count:
        child = 2 * k + 1
        if child + 1 < count and waiting[child + 1] > waiting[child]:
            child += 1
        if waiting[child] <= last:
            break
        waiting[k] = waiting[child]
        k = child
    waiting[k] = last
    return count


class Bounds(NamedTuple):
    """When a search ends: poses below `min_score`, or `share` of the best score, are not looked for."""

    min_score: float
    share: float
    max_poses: int


class SearchState(NamedTuple):
    """A search under way.

    `cells` (angles, n, 2) are the points by angle, `first` (m, 2) the largest blocks' rows and columns; `waiting` the
    heap; `found` (most, 4) row, column, angle and score of the poses found, and `numbers` 1 + the number of the newest
    one by its row, column and angle in steps of APART_CELLS and APART_ANGLES; `best` (1,) the best score of a pose yet.
    `counts` are the poses and blocks compared, the first blocks compared, the blocks waiting, the poses found, and 1 if
    any was given up.
    """

    cells: NDArray[np.int32]
    first: Ints
    waiting: Ints
    found: Floats
    numbers: NDArray[np.int32]
    best: Floats
    counts: Ints
    bounds: Bounds


def begun(
    cells: NDArray[np.int32], first: Ints, field: PlaceField, most: int, max_waiting: int, bounds: Bounds
) -> SearchState:
    """A search at its start."""
    rows, columns = field.pooled[0].shape
    shape = (rows // APART_CELLS + 1, columns // APART_CELLS + 1, len(cells) // APART_ANGLES + 1)
    waiting, numbers = np.zeros(max_waiting, np.int64), np.zeros(shape, np.int32)
    return SearchState(cells, first, waiting, np.zeros((most, 4)), numbers, np.zeros(1), np.zeros(5, np.int64), bounds)


@njit(cache=True)
def advance(state: SearchState, field: PlaceField, work: int) -> bool:
    """Compare about `work` poses more; True once the search has ended."""
    counts, bounds = state.counts, state.bounds
    angles, top = state.cells.shape[0], len(field.pooled) - 1
    until = min(counts[0] + work, bounds.max_poses)
    while counts[1] < state.first.shape[0] * angles and counts[0] < until:
        k, a = counts[1] // angles, counts[1] % angles
        counts[1] += 1
        _compare(state, field, top, state.first[k, 0], state.first[k, 1], a)
    while counts[2] > 0 and counts[0] < until:
        block = unpacked(state.waiting[0])
        if block.score < _least(state) or counts[3] == state.found.shape[0]:
            return True
        counts[0] += 1  # the heap costs as much as a pose
        counts[2] = pop(state.waiting, counts[2])
        _divide(state, field, block)
    all_compared = counts[2] == 0 and counts[1] == state.first.shape[0] * angles
    return bool(all_compared or counts[0] >= bounds.max_poses)


@njit(cache=True)
def _least(state: SearchState) -> float:
    """The score below which a pose is neither a place nor a rival of the best."""
    least: float = max(state.bounds.min_score, state.bounds.share * state.best[0])
    return least


@njit(cache=True)
def _compare(state: SearchState, field: PlaceField, level: int, row: int, column: int, angle: int) -> float:
    """The bound of a block, which then waits if it may hold a place."""
    score = bound(state.cells[angle], field, level, row, column)
    state.counts[0] += 1
    if level == 0 and score > state.best[0]:
        state.best[0] = score
    if score >= _least(state):
        if state.counts[2] < state.waiting.shape[0]:
            state.counts[2] = push(state.waiting, state.counts[2], packed(score, level, row, column, angle))
        else:
            state.counts[4] = 1
    return score


@njit(cache=True)
def _divide(state: SearchState, field: PlaceField, block: Block) -> None:
    """Compare the four parts of a block; a single pose is found if it is not near to one that was found before."""
    if block.level == 0:
        _find(state, block)
        return
    level, half = block.level - 1, 1 << (block.level - 1)
    for row in (block.row, block.row + half):
        for column in (block.column, block.column + half):
            i, j = row >> level, column >> level
            is_open = i < field.open[level].shape[0] and j < field.open[level].shape[1] and field.open[level][i, j]
            if is_open:
                _compare(state, field, level, row, column, block.angle)


@njit(cache=True)
def _find(state: SearchState, block: Block) -> None:
    number, numbers = state.counts[3], state.numbers
    i, j, k = block.row // APART_CELLS, block.column // APART_CELLS, block.angle // APART_ANGLES
    for near_i in range(max(i - 1, 0), min(i + 2, numbers.shape[0])):
        for near_j in range(max(j - 1, 0), min(j + 2, numbers.shape[1])):
            for dk in range(-1, 2):
                other = numbers[near_i, near_j, (k + dk) % numbers.shape[2]]
                if other > 0 and _is_near(state.found[other - 1], block, state.cells.shape[0]):
                    return
    found = state.found[number]
    found[0], found[1], found[2], found[3] = block.row, block.column, block.angle, block.score
    numbers[i, j, k] = number + 1
    state.counts[3] += 1


@njit(cache=True)
def _is_near(found: Floats, block: Block, angles: int) -> bool:
    turned = abs(block.angle - found[2])
    apart = max(abs(block.row - found[0]), abs(block.column - found[1]))
    return bool(apart < APART_CELLS and min(turned, angles - turned) < APART_ANGLES)
