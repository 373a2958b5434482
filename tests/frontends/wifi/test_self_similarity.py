"""What a similarity means in metres, against pairs drawn from a known law."""

import math

import numpy as np
import pytest

from wayfi.backend.pose2 import Floats
from wayfi.frontends.wifi.self_similarity import SelfSimilarity
from wayfi.frontends.wifi.wifi_config import SelfSimilarityConfig

CONFIG = SelfSimilarityConfig()
NEAR_M = 3.0


def faded(distance_m: Floats, rng: np.random.Generator) -> Floats:
    """Similarity that falls from 0.9 over about 5 m, with scatter."""
    return np.asarray(np.clip(0.9 * np.exp(-distance_m / 5) + rng.normal(0, 0.03, len(distance_m)), 0, 1))


def learnt(pairs: int, seed: int = 0) -> tuple[SelfSimilarity, Floats, Floats]:
    rng = np.random.default_rng(seed)
    distance = rng.uniform(0, CONFIG.reach_m, pairs)
    similarity = faded(distance, rng)
    own = SelfSimilarity(CONFIG)
    for k in range(0, pairs, 25):
        own.add(similarity[k : k + 25], distance[k : k + 25])
    return own, similarity, distance


def test_nothing_is_known_before_enough_was_heard() -> None:
    own, *_ = learnt(50)
    assert own.distance(0.5, NEAR_M).rms_m == math.inf
    assert own.distance(0.5, NEAR_M).near == 0.0


@pytest.mark.parametrize("similarity", [0.15, 0.3, 0.5, 0.7])
def test_a_similarity_means_the_distances_that_were_driven_at_it(similarity: float) -> None:
    own, seen, distance = learnt(20_000)
    alike = (similarity <= seen) & (seen < similarity + 0.02)
    found = own.distance(similarity, NEAR_M)
    assert found.rms_m == pytest.approx(math.sqrt((distance[alike] ** 2).mean()), rel=0.1)
    assert found.near == pytest.approx((distance[alike] < NEAR_M).mean(), abs=0.08)


def test_more_alike_is_never_said_to_be_much_further() -> None:
    own, *_ = learnt(5_000)
    rms = [own.distance(s, NEAR_M).rms_m for s in np.linspace(0.05, 1.0, 40)]
    assert max(np.diff(rms)) < 0.3
    assert rms[0] > 8 > 2 > rms[-1]


def test_what_is_rarer_than_can_be_learnt_is_judged_by_what_is_next_to_it() -> None:
    own, *_ = learnt(5_000)
    assert own.distance(0.999, NEAR_M).rms_m == pytest.approx(own.distance(0.88, NEAR_M).rms_m, abs=0.5)


def test_pairs_beyond_the_reach_are_left_out() -> None:
    own = SelfSimilarity(CONFIG)
    own.add(np.full(200, 0.5), np.full(200, CONFIG.reach_m + 1))
    assert own.distance(0.5, NEAR_M).rms_m == math.inf
    own.add(np.empty(0), np.empty(0))
