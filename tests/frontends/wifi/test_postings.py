"""Lists of who heard what, against counting by hand; and that no more of them is read than allowed."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from wayfi.frontends.wifi.postings import BLOCK, ENOUGH, MOST_OF_LIST, STEPS_APART, Overlap, Postings
from wayfi.frontends.wifi.readings import LOWEST_DBM

SIGMA_DB = 6.0
AT_MOST_READ = ENOUGH + (2 * STEPS_APART + 1) * MOST_OF_LIST

Levels = dict[int, float]
LEVELS = st.dictionaries(st.integers(0, 9), st.floats(-100, -20, width=32), min_size=1, max_size=6)


def arrays(levels: Levels) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    return np.array(list(levels), np.int32), np.array(list(levels.values()), np.float32)


def postings_of(prints: list[Levels]) -> Postings:
    postings = Postings(SIGMA_DB)
    for number, levels in enumerate(prints):
        postings.add(number, *arrays(levels))
    return postings


def overlap(postings: Postings, levels: Levels, before: int, most: int) -> Overlap:
    return postings.overlap(*arrays(levels), np.ones(len(levels)), before, most)


def shared(a: Levels, b: Levels) -> float:
    """What two fingerprints share, to a step of RSSI."""
    apart = [abs(step(a[ap]) - step(b[ap])) for ap in a.keys() & b.keys()]
    return sum(math.exp(-0.5 * steps**2) for steps in apart if steps <= STEPS_APART)


def step(rssi: float) -> int:
    return int((np.float32(rssi) - LOWEST_DBM) / SIGMA_DB)


@settings(deadline=None)
@given(st.lists(LEVELS, min_size=1, max_size=12), LEVELS, st.integers(0, 12), st.integers(1, 5))
def test_those_that_share_most_are_named(prints: list[Levels], levels: Levels, before: int, most: int) -> None:
    before = min(before, len(prints))
    sharing = [round(shared(levels, earlier), 9) for earlier in prints[:before]]
    by_share = sorted((n for n in range(before) if sharing[n] > 0), key=lambda n: (-sharing[n], n))
    found = overlap(postings_of(prints), levels, before, most).numbers.tolist()
    assert sorted(sharing[n] for n in found) == sorted(sharing[n] for n in by_share[:most])
    assert found == sorted(set(found))


def test_of_equals_the_earlier_are_named() -> None:
    found = overlap(postings_of([{0: -50.0}] * 100), {0: -50.0}, 80, 3)
    assert found.numbers.tolist() == [0, 1, 2]


def test_weights_decide_what_counts() -> None:
    postings = postings_of([{0: -50.0, 1: -50.0}, {2: -50.0}])
    levels = arrays({0: -50.0, 1: -50.0, 2: -50.0})
    assert postings.overlap(*levels, np.array([1.0, 1.0, 1.0]), 2, 1).numbers.tolist() == [0]
    assert postings.overlap(*levels, np.array([1.0, 1.0, 2.5]), 2, 1).numbers.tolist() == [1]


@pytest.mark.parametrize("ap", [0, 255, 256, 100_000])
def test_what_nobody_heard_before_names_nobody(ap: int) -> None:
    found = overlap(postings_of([{1: -50.0}]), {ap: -50.0}, 1, 5)
    assert len(found.numbers) == found.postings_read == 0


@pytest.mark.parametrize("rssi", [-130.0, -120.0, 0.0, 5.0])
def test_rssi_at_the_ends_of_the_range_and_beyond_has_its_list(rssi: float) -> None:
    assert overlap(postings_of([{0: rssi}]), {0: rssi}, 1, 5).numbers.tolist() == [0]


def test_a_query_leaves_nothing_behind() -> None:
    postings = postings_of([{0: -50.0}, {1: -50.0}, {0: -50.0, 1: -50.0}])
    first = overlap(postings, {0: -50.0}, 3, 5)
    overlap(postings, {1: -50.0}, 3, 5)
    again = overlap(postings, {0: -50.0}, 3, 5)
    np.testing.assert_array_equal(first.numbers, again.numbers)
    assert first.postings_read == again.postings_read


def test_of_a_full_list_the_newest_are_read() -> None:
    postings = postings_of([{0: -50.0}] * (MOST_OF_LIST + BLOCK + 7))
    found = overlap(postings, {0: -50.0}, MOST_OF_LIST + BLOCK + 7, MOST_OF_LIST + BLOCK)
    assert found.postings_read == MOST_OF_LIST
    assert found.numbers.tolist() == list(range(BLOCK + 7, MOST_OF_LIST + BLOCK + 7))


def test_the_work_is_bounded_however_much_is_stored() -> None:
    everything = {ap: -50.0 - ap for ap in range(40)}
    postings = Postings(SIGMA_DB)
    read = []
    for number in range(2 * MOST_OF_LIST):
        postings.add(number, *arrays(everything))
        if number + 1 in (100, MOST_OF_LIST, 2 * MOST_OF_LIST):
            read.append(overlap(postings, everything, number + 1, 10).postings_read)
    assert read[0] == 40 * 100
    assert ENOUGH < read[1] == read[2] <= AT_MOST_READ
