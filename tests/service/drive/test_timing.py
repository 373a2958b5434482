"""The stage timer: its memory is bounded, its totals exact, its percentiles and tenths those of the calls."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfi.service.drive.timing import MOST_BLOCKS, CostAlong, StageCost, StageTimer

LENGTHS = st.lists(st.floats(1e-6, 10.0), min_size=1, max_size=1500)


def cost_of(lengths_s: list[float]) -> StageCost:
    cost = StageCost()
    for seconds in lengths_s:
        cost.add(seconds)
    return cost


@given(LENGTHS, st.sampled_from([0.5, 0.99]))
def test_a_quantile_is_that_of_the_calls_to_a_few_percent(lengths_s: list[float], share: float) -> None:
    exact = np.quantile(lengths_s, share, method="inverted_cdf")
    assert cost_of(lengths_s).quantile_s(share) == pytest.approx(exact, rel=0.026)


@given(LENGTHS)
def test_the_total_and_the_longest_are_exact(lengths_s: list[float]) -> None:
    summary = cost_of(lengths_s).summary()
    assert summary["seconds"] == pytest.approx(sum(lengths_s), rel=1e-9, abs=6e-4)
    assert summary["max_ms"] == round(max(lengths_s) * 1e3, 3)
    assert summary["p50_ms"] <= summary["p99_ms"] <= summary["max_ms"]


@pytest.mark.parametrize("calls", [10, MOST_BLOCKS, MOST_BLOCKS + 1, 54_321])
def test_the_tenths_are_those_of_the_drive(calls: int) -> None:
    lengths_s = np.linspace(1.0, 3.0, calls)
    along = CostAlong()
    for seconds in lengths_s:
        along.add(float(seconds))
    tenth = calls // 10
    assert along.mean_s(0.0, 0.1) == pytest.approx(lengths_s[:tenth].mean(), rel=0.01)
    assert along.mean_s(0.9, 1.0) == pytest.approx(lengths_s[-tenth:].mean(), rel=0.01)
    assert along.mean_s(0.0, 1.0) == pytest.approx(2.0)


def test_a_long_drive_is_kept_in_a_bounded_space() -> None:
    cost = StageCost()
    for seconds in np.random.default_rng(0).lognormal(-7.0, 2.0, 20_000):
        cost.add(float(seconds))
    assert len(cost._along._blocks_s) <= MOST_BLOCKS
    assert len(cost._bins) < 500


def test_stages_are_timed_and_the_last_calls_are_taken_once() -> None:
    timer = StageTimer()
    with timer("outer"), timer("inner"):
        pass
    last = timer.pop_durations()
    assert last["outer"] >= last["inner"] >= 0
    assert timer.pop_durations() == {}
    assert list(timer.report()) == ["inner", "outer"]
