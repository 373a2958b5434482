"""Branch and bound: a block's bound holds for its poses, and the best pose found is that of comparing all."""

import numpy as np
from building_maps.seen import seen_map
from hypothesis import given, settings
from hypothesis import strategies as st
from rooms import HALL, see

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.localization.branch_and_bound import (
    Block,
    Bounds,
    advance,
    begun,
    bound,
    cells_at,
    packed,
    pop,
    push,
    unpacked,
)
from wayfi.frontends.localization.place_field import LEVELS, PlaceField, building_steps
from wayfi.frontends.localization.search_config import MapSearchConfig

POSES = np.array([[-4.5, -2.5, 0.0], [0.0, -2.5, 0.0], [7.5, 4.0, 2.0], [7.5, -3.0, 1.0], [-4.5, 3.5, -2.0]])
ANGLES = np.arange(12, dtype=np.float64) * (2 * np.pi / 12)


def field() -> PlaceField:
    *_, built = building_steps(seen_map((HALL, POSES)), MapSearchConfig())
    assert built is not None
    return built


FIELD = field()
CELLS = cells_at(see(HALL, Pose2(0.3, -2.0, 0.0), np.random.default_rng(1)).points[::4], ANGLES, FIELD.cell_m)


def all_scores(angle: int) -> np.ndarray:
    rows, columns = FIELD.open[0].shape
    scores = [[bound(CELLS[angle], FIELD, 0, r, c) for c in range(columns)] for r in range(rows)]
    return np.where(FIELD.open[0], scores, 0.0)


@settings(deadline=None)  # the first call compiles
@given(st.integers(1, LEVELS - 1), st.integers(0, 10), st.integers(0, 6), st.integers(0, 11))
def test_no_pose_of_a_block_has_a_score_above_its_bound(level: int, i: int, j: int, angle: int) -> None:
    side = 2**level
    scores = [
        bound(CELLS[angle], FIELD, 0, r, c)
        for r in range(i * side, (i + 1) * side)
        for c in range(j * side, (j + 1) * side)
    ]
    assert max(scores) <= bound(CELLS[angle], FIELD, level, i * side, j * side)


def test_the_first_pose_found_is_the_best_of_all_and_all_rivals_are_found() -> None:
    first = np.argwhere(FIELD.open[-1]).astype(np.int64) * 2 ** (LEVELS - 1)
    state = begun(CELLS, first, FIELD, 1000, 100_000, Bounds(0.3, 0.6, 10**9))
    while not advance(state, FIELD, 1000):
        pass
    found = state.found[: state.counts[3]]
    scores = np.stack([all_scores(angle) for angle in range(len(ANGLES))])
    assert np.isclose(found[0, 3], scores.max(), atol=1e-4)
    for angle, row, column in np.argwhere(scores >= 0.6 * scores.max() + 1e-4):
        turned = np.abs(found[:, 2] - angle)
        near = np.abs(found[:, :2] - (row, column)).max(axis=1) < 2
        assert (near & (np.minimum(turned, len(ANGLES) - turned) < 4)).any()


@settings(deadline=None)  # the first call compiles
@given(
    st.floats(0.0, 1.0),
    st.integers(0, LEVELS - 1),
    st.integers(0, 60_000),
    st.integers(0, 60_000),
    st.integers(0, 4000),
)
def test_a_block_is_what_was_packed(score: float, level: int, row: int, column: int, angle: int) -> None:
    block = Block(*unpacked(packed(score, level, row, column, angle)))
    assert block[1:] == (level, row, column, angle)
    assert score <= block.score < score + 1e-4


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.integers(0, 2**62), max_size=60))
def test_the_heap_gives_the_greatest_first(blocks: list[int]) -> None:
    waiting, count = np.zeros(60, np.int64), 0
    for block in blocks:
        count = push(waiting, count, block)
    taken = []
    while count:
        taken.append(int(waiting[0]))
        count = pop(waiting, count)
    assert taken == sorted(blocks, reverse=True)
