"""The Bayes tree of a drive without loops: shallow however long the drive is, and the same estimate."""

import gtsam
import numpy as np
import pytest
from graphs import PRIOR, drive, loops

from wayfi.backend.graph import isam
from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.balance import BLOCK, blocks_ending_at, dissection
from wayfi.backend.graph.pose_graph import PoseGraph


def depth(graph: PoseGraph, leaf: int) -> int:
    """How many states iSAM2 eliminates again for a change of keyframe `leaf`: those on its way to the tree's root."""
    nothing = gtsam.NonlinearFactorGraph(), gtsam.Values()
    return int(graph._isam.tree.update(*nothing, dissection([leaf], [], [])).getVariablesReeliminated())


def driven(keyframes: int) -> PoseGraph:
    graph = PoseGraph(BackendConfig(), PRIOR)
    drive(graph, loops(np.zeros(4), keyframes // 80), {})
    return graph


def test_only_the_newest_blocks_are_eliminated_again() -> None:
    assert blocks_ending_at(0) == blocks_ending_at(BLOCK + 1) == []
    assert blocks_ending_at(BLOCK) == list(range(BLOCK + 1))
    second_level = blocks_ending_at(8 * BLOCK)
    assert set(second_level) == {*range(7 * BLOCK, 8 * BLOCK + 1), *range(0, 8 * BLOCK, BLOCK)}
    work = [len(blocks_ending_at(newest)) for newest in range(100_000)]
    assert sum(work) < 1.2 * len(work)


def test_the_estimate_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    balanced = driven(320)
    monkeypatch.setattr(isam, "blocks_ending_at", lambda _: [])
    deep = driven(320)
    np.testing.assert_allclose(balanced.poses(), deep.poses(), atol=1e-9)
    np.testing.assert_allclose(balanced.relative_covariance(3, 300), deep.relative_covariance(3, 300), rtol=1e-6)


def test_a_change_far_back_touches_as_few_states_in_a_long_drive_as_in_a_short_one() -> None:
    assert depth(driven(320), 3) < 2 * BLOCK
    assert depth(driven(1280), 3) < 2 * BLOCK
