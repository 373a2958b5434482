"""Candidates by similarity, and closures between two sequences of fingerprints."""

import numpy as np
import pytest
from reproduced_drives import alike, path_of, radio, ring, silent

from wayfi.backend.pose2 import Floats, Pose2, between_all, compose_all
from wayfi.service.reproduction.similarities import all_similarities
from wayfi.service.reproduction.wifi_closures import candidate_pairs, sequence_closures


def test_a_candidate_is_the_most_similar_fingerprint_fifty_metres_before() -> None:
    truth = ring(2)
    similarity, path_m = all_similarities(radio(truth[:, :2]), silent), path_of(truth)
    pairs = candidate_pairs(similarity, path_m)
    expected = []
    for b in range(len(truth)):
        before = [a for a in range(b) if path_m[b] - path_m[a] >= 50.0 and similarity[a, b] >= 0.3]
        if before:
            expected.append((max(before, key=lambda a: similarity[a, b]), b))
    assert pairs.tolist() == [list(pair) for pair in expected]
    assert len(pairs) > 72  # the second lap repeats the first
    assert np.median(np.hypot(*(truth[pairs[:, 0], :2] - truth[pairs[:, 1], :2]).T)) == 0.0


def test_a_drive_that_never_comes_back_has_no_candidate() -> None:
    straight = np.stack([np.arange(300) * 0.5, np.zeros(300), np.zeros(300)], axis=1)
    assert candidate_pairs(alike(straight, straight), path_of(straight)).shape == (0, 2)


@pytest.mark.parametrize(("similar", "found"), [(0.29, 0), (0.31, 1)])
def test_a_candidate_is_similar_to_three_tenths_at_least(similar: float, found: int) -> None:
    similarity = np.array([[1.0, similar], [similar, 1.0]], np.float32)
    assert len(candidate_pairs(similarity, np.array([0.0, 60.0]))) == found


def two_passes(drift: Pose2, backwards: bool, offset_m: float = 0.0) -> tuple[Floats, Floats, int]:
    """True poses of two passes around one corner, what odometry makes of them, and the number in a pass."""
    first = ring(1)[30:80]
    second = ring(1, 0.25)[60 + round(4 * offset_m) : 160 + round(4 * offset_m) : 2]
    if backwards:
        second = second[::-1] + np.array([0.0, 0.0, np.pi])
    return np.concatenate([first, second]), np.concatenate([first, compose_all(drift.array(), second)]), len(first)


@pytest.mark.parametrize("backwards", [False, True])
def test_the_pose_between_two_passes_is_recovered(backwards: bool) -> None:
    truth, poses, n = two_passes(Pose2(7.0, -3.0, 0.6), backwards)
    pairs = np.array([(i, 2 * n - 1 - i if backwards else n + i) for i in (22, 27)])
    closures = sequence_closures(pairs, alike(truth, truth, 0.1), poses, 40, 1)
    assert closures.pairs.tolist() == pairs.tolist()
    errors = between_all(between_all(truth[pairs[:, 0]], truth[pairs[:, 1]]), closures.T_a_b)
    np.testing.assert_allclose(errors, 0.0, atol=1e-6)


def test_two_neighbours_give_the_place_between_them() -> None:
    """The second pass stops halfway between the stops of the first: one neighbour is a quarter of a metre off."""
    truth, poses, n = two_passes(Pose2(7.0, -3.0, 0.6), False, 0.25)
    similarity = alike(truth, truth, 0.2)
    pair = np.array([[8, n + 8]])
    true = between_all(truth[pair[:, 0]], truth[pair[:, 1]])
    found = [sequence_closures(pair, similarity, poses, 14, k).T_a_b for k in (1, 2)]
    one, two = (float(np.hypot(*between_all(true, T)[0, :2])) for T in found)
    assert two < 0.02
    assert one > 0.2


def test_a_window_is_of_w_fingerprints_around_each() -> None:
    truth, poses, n = two_passes(Pose2(7.0, -3.0, 0.6), False)
    similarity, pair = alike(truth, truth), np.array([[25, n + 25]])
    found = sequence_closures(pair, similarity, poses, 20, 2).T_a_b
    outside = np.ones(len(poses), bool)
    outside[[*range(15, 36), *range(n + 15, n + 36)]] = False
    elsewhere = poses + 3.0 * outside[:, None]
    np.testing.assert_array_equal(sequence_closures(pair, similarity, elsewhere, 20, 2).T_a_b, found)
    for edge in (15, 35, n + 15, n + 35):
        bent = poses.copy()
        bent[edge, :2] += 3.0
        assert not np.array_equal(sequence_closures(pair, similarity, bent, 20, 2).T_a_b, found)


def test_sequences_that_do_not_fit_are_refused() -> None:
    truth, poses, n = two_passes(Pose2(7.0, -3.0, 0.6), False)
    shuffled = poses.copy()
    shuffled[n:] = np.random.default_rng(1).permutation(poses[n:])
    pair = np.array([[25, n + 25]])
    assert len(sequence_closures(pair, alike(truth, truth), poses, 40, 2)) == 1
    assert len(sequence_closures(pair, alike(truth, truth), shuffled, 40, 2)) == 0


def test_sequences_with_nothing_in_common_are_refused() -> None:
    poses = ring(1)
    assert len(sequence_closures(np.array([[0, 100]]), np.zeros((144, 144), np.float32), poses, 80, 2)) == 0
