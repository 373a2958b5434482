"""The clock of a stream against its log times: offset, spread, steps, and playbacks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.inspecting.clocks import Stamps, clock_of

START_NS = 1_700_000_000 * SECOND_NS


def log_times(count: int, hz: float = 10.0) -> Stamps:
    return START_NS + (np.arange(count) * SECOND_NS / hz).astype(np.int64)


def test_there_is_no_clock_without_messages_and_one_message_has_an_offset() -> None:
    nothing = np.zeros(0, np.int64)
    assert clock_of(nothing, nothing) is None
    one = clock_of(np.array([START_NS + SECOND_NS]), np.array([START_NS]))
    assert one is not None
    assert (one.offset_s, one.spread_s, one.steps, one.playback, one.still) == (1.0, 0.0, 0, None, False)


@given(st.floats(-1e6, 1e6), st.integers(20, 200))
def test_a_constant_offset_is_found_and_is_no_step(offset_s: float, count: int) -> None:
    at = log_times(count)
    found = clock_of(at + round(offset_s * SECOND_NS), at)
    assert found is not None
    assert found.offset_s == pytest.approx(offset_s, abs=1e-5)
    assert (found.steps, found.in_real_time, found.still) == (0, True, False)
    assert found.spread_s < 1e-5


@given(st.floats(0.6, 1e5), st.sampled_from([-1.0, 1.0]), st.integers(10, 90))
def test_a_lasting_step_is_counted_once_and_a_late_message_never(size_s: float, side: float, at: int) -> None:
    log_ns = log_times(100)
    stepped = log_ns.copy()
    stepped[at:] += round(side * size_s * SECOND_NS)
    found = clock_of(stepped, log_ns)
    assert found is not None
    assert (found.steps, found.largest_step_s) == (1, pytest.approx(side * size_s, abs=1e-4))
    late = log_ns.copy()
    late[at] -= round(size_s * SECOND_NS)
    one = clock_of(late, log_ns)
    assert one is not None
    assert one.steps == 0


def test_jitter_is_spread_and_stamps_of_any_size_are_survived() -> None:
    at = log_times(1000)
    jitter = np.random.default_rng(0).uniform(-0.2, 0.2, 1000)
    found = clock_of(at + (jitter * SECOND_NS).astype(np.int64), at)
    assert found is not None
    assert found.spread_s == pytest.approx(0.36, abs=0.03)
    assert found.steps == 0
    extremes = np.array([-(2**63), 2**63 - 1] * 20, np.int64)
    wild = clock_of(extremes, extremes[::-1].copy())
    assert wild is not None
    assert np.isfinite([wild.offset_s, wild.spread_s, wild.largest_step_s]).all()
