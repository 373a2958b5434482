"""Similarity over the inverted index, against the formula over plain dictionaries."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.frontends.wifi.fingerprint_index import EXAMINED, MOST_SIMILAR, FingerprintIndex
from wayfi.frontends.wifi.readings import Readings

SIGMA_DB = 6.0


def bssid(number: int) -> str:
    return "02:00:00:00:" + f"{number >> 8:02x}:{number & 255:02x}"


Levels = dict[int, float]
LEVELS = st.dictionaries(st.integers(0, 12), st.floats(-100, -20, width=32), min_size=1, max_size=8)


def readings(levels: Levels) -> Readings:
    return Readings(
        tuple(bssid(number) for number in levels),
        np.array(list(levels.values()), np.float32),
        np.zeros(len(levels), np.float32),
    )


def formula(a: Levels, b: Levels) -> float:
    """H / (L_a + L_b - H) times the mean over the H common access points of exp(-(a - b)^2 / 2 sigma^2)."""
    common = a.keys() & b.keys()
    if not common:
        return 0.0
    likelihoods = [math.exp(-((a[n] - b[n]) ** 2) / (2 * SIGMA_DB**2)) for n in common]
    return len(common) / (len(a) + len(b) - len(common)) * (sum(likelihoods) / len(common))


def index_of(prints: list[Levels]) -> FingerprintIndex:
    index = FingerprintIndex(SIGMA_DB)
    assert [index.add(readings(levels)) for levels in prints] == list(range(len(prints)))
    return index


@settings(deadline=None)
@given(st.lists(LEVELS, min_size=2, max_size=8))
def test_similarity_is_the_formula(prints: list[Levels]) -> None:
    index = index_of(prints)
    for number in range(len(prints)):
        expected = [formula(prints[number], earlier) for earlier in prints[:number]]
        np.testing.assert_allclose(index.similarity(number), expected, atol=1e-5)


@settings(deadline=None)
@given(st.lists(LEVELS, min_size=1, max_size=8))
def test_the_matrix_is_symmetric_one_on_its_diagonal_and_agrees_with_the_index(prints: list[Levels]) -> None:
    index, every = index_of(prints), np.arange(len(prints))
    matrix = index.similarities(every, every)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
    np.testing.assert_allclose(np.diag(matrix), 1.0, atol=1e-12)
    assert (matrix >= 0).all()
    assert (matrix <= 1 + 1e-12).all()
    for number in every:
        np.testing.assert_allclose(index.similarity(number), matrix[number, :number], atol=1e-12)


def test_rows_and_columns_are_those_asked_for() -> None:
    prints: list[Levels] = [{0: -50.0}, {0: -56.0}, {1: -50.0}, {0: -50.0, 1: -50.0}]
    matrix = index_of(prints).similarities(np.array([3, 0]), np.array([1, 2]))
    expected = [[formula(prints[r], prints[c]) for c in (1, 2)] for r in (3, 0)]
    np.testing.assert_allclose(matrix, expected, atol=1e-6)
    assert matrix[1, 1] == 0.0


@settings(deadline=None)
@given(st.lists(LEVELS, min_size=1, max_size=8), st.lists(st.floats(0.01, 2.0), min_size=13, max_size=13))
def test_an_access_point_counts_by_its_weight(prints: list[Levels], weights: list[float]) -> None:
    """As if it were so many access points."""
    index, every = index_of(prints), np.arange(len(prints))
    heard = list(dict.fromkeys(n for levels in prints for n in levels))
    index.weigh(np.arange(len(heard), dtype=np.int32), np.array([weights[n] for n in heard]))
    expected = [[weighted(a, b, weights) for b in prints] for a in prints]
    np.testing.assert_allclose(index.similarities(every, every), expected, atol=1e-5)


def weighted(a: Levels, b: Levels, weights: list[float]) -> float:
    alike = sum(weights[n] * math.exp(-((a[n] - b[n]) ** 2) / (2 * SIGMA_DB**2)) for n in a.keys() & b.keys())
    return alike / sum(weights[n] for n in a.keys() | b.keys())


def test_the_index_grows_and_forgets_nothing() -> None:
    rng = np.random.default_rng(0)
    prints: list[Levels] = [
        {int(n): float(rng.uniform(-90, -30)) for n in rng.choice(2000, 40, replace=False)} for _ in range(600)
    ]
    index = index_of(prints)
    assert index.size == 600
    expected = [formula(prints[-1], earlier) for earlier in prints[:-1]]
    np.testing.assert_allclose(index.similarity(599), expected, atol=1e-5)
    some = np.array([0, 17, 300, 598])
    plain = [[formula(prints[r], prints[c]) for c in some] for r in some]
    np.testing.assert_allclose(index.similarities(some, some), plain, atol=1e-5)


# The most similar, at a bounded cost


def exhaustive(index: FingerprintIndex, number: int, before: int) -> list[tuple[int, float]]:
    """The most similar first, of equals the earliest; without those that need not be found."""
    similarity = index.similarity(number)[:before]
    order = np.argsort(-similarity, kind="stable")[:MOST_SIMILAR]
    return [(int(n), float(similarity[n])) for n in order if similarity[n] > math.exp(-2)]


def found(index: FingerprintIndex, number: int, before: int) -> list[tuple[int, float]]:
    similar = index.similar(number, before)
    pairs = zip(similar.numbers.tolist(), similar.similarity.tolist(), strict=True)
    return [pair for pair in pairs if pair[1] > math.exp(-2)]


def laps(rounds: int, rng: np.random.Generator) -> list[Levels]:
    """A corridor of 100 m driven again and again: 60 access points, fading of 3 dB, a fingerprint every metre."""
    access_points = rng.uniform((0.0, -10.0), (100.0, 10.0), (60, 2))
    places = np.column_stack([np.tile(np.arange(100.0), rounds), rng.normal(0.0, 0.3, 100 * rounds)])
    distance = np.maximum(np.hypot(*(places[:, None] - access_points).transpose(2, 0, 1)), 1.0)
    rssi = -35.0 - 35.0 * np.log10(distance) + rng.normal(0.0, 3.0, distance.shape)
    return [{n: float(level) for n, level in enumerate(here) if level > -85.0} for here in rssi]


@settings(deadline=None)
@given(st.lists(LEVELS, min_size=1, max_size=20), st.data())
def test_the_most_similar_are_those_of_the_exhaustive_search(prints: list[Levels], data: st.DataObject) -> None:
    index = index_of(prints)
    for _ in range(3):
        number = data.draw(st.integers(0, len(prints) - 1))
        before = data.draw(st.integers(0, number))
        assert found(index, number, before) == exhaustive(index, number, before)


def test_the_most_similar_of_a_corridor_driven_again_are_those_of_the_exhaustive_search() -> None:
    """While no more are stored than are examined."""
    prints = laps(EXAMINED // 100, np.random.default_rng(0))
    index = index_of(prints)
    for number in range(30, len(prints)):
        assert found(index, number, number - 30) == exhaustive(index, number, number - 30)


def test_in_a_long_drive_the_best_is_found_nearly_always() -> None:
    prints = laps(40, np.random.default_rng(1))
    index = index_of(prints)
    numbers = range(3000, 4000, 7)
    best = [found(index, n, n - 30)[:1] == exhaustive(index, n, n - 30)[:1] for n in numbers]
    assert np.mean(best) > 0.99


def test_the_most_similar_are_the_same_in_a_second_index_and_in_a_second_look() -> None:
    prints = laps(8, np.random.default_rng(2))
    one, other = index_of(prints), index_of(prints)
    for number in (200, 799, 400):
        expected = found(one, number, number - 30)
        assert found(other, number, number - 30) == found(one, number, number - 30) == expected


def test_of_equally_similar_ones_the_earliest_come_first() -> None:
    index = index_of([{0: -50.0, 1: -60.0}] * 100)
    similar = index.similar(99, 90)
    assert similar.numbers.tolist() == list(range(MOST_SIMILAR))
    assert set(similar.similarity.tolist()) == {1.0}


def test_where_nothing_was_stored_before_nothing_is_similar() -> None:
    similar = index_of([{0: -50.0}, {0: -50.0}]).similar(1, 0)
    assert similar.numbers.shape == similar.similarity.shape == (0,)


def test_access_points_never_heard_before_are_no_match() -> None:
    prints: list[Levels] = [dict.fromkeys(range(k, k + 8), -50.0) for k in range(0, 1000, 8)]
    index = index_of(prints)
    assert len(index.similar(len(prints) - 1, len(prints) - 1).numbers) == 0
