"""The times of a cloud's points: every unit and origin that drivers use comes to seconds after the stamp."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfi.recordings.ros.point_times import seconds_after_stamp

STAMP_NS = 1_700_000_000_123_456_789
SWEEP_S = np.linspace(0.0, 0.1, 900)


@pytest.mark.parametrize(
    "times",
    [
        SWEEP_S.astype(np.float32),
        (SWEEP_S * 1e3).astype(np.float32),
        (SWEEP_S * 1e6).astype(np.uint32),
        (SWEEP_S * 1e9).astype(np.uint32),
        (SWEEP_S * 1e9).astype(np.int32),
        STAMP_NS * 1e-9 + SWEEP_S,
        (STAMP_NS * 1e-9 + SWEEP_S) * 1e9,
        (STAMP_NS * 1e-9 + SWEEP_S).astype(">f8"),
        SWEEP_S + 5_000.0,
    ],
    ids=["s", "ms", "us", "ns", "signed ns", "epoch s", "epoch ns", "big endian", "since the sensor was switched on"],
)
def test_every_unit_and_origin_is_understood(times: np.ndarray) -> None:
    seconds = seconds_after_stamp(times, STAMP_NS)
    assert seconds is not None
    assert seconds.dtype == np.float32
    np.testing.assert_allclose(seconds, SWEEP_S, atol=2e-6)


def test_a_stamp_at_the_end_leaves_times_before_it() -> None:
    for times in (SWEEP_S - 0.1, STAMP_NS * 1e-9 + SWEEP_S - 0.1):
        seconds = seconds_after_stamp(times, STAMP_NS)
        assert seconds is not None
        np.testing.assert_allclose(seconds, SWEEP_S - 0.1, atol=2e-6)


@pytest.mark.parametrize("times", [np.zeros(5), np.full(5, np.nan), np.full(5, 1e9), np.array([0.0, 1e300])])
def test_times_that_say_nothing_are_unknown(times: np.ndarray) -> None:
    assert seconds_after_stamp(times, STAMP_NS) is None


def test_a_time_that_is_not_finite_counts_as_the_first() -> None:
    seconds = seconds_after_stamp(np.array([0.01, np.nan, 0.05, np.inf]), STAMP_NS)
    assert seconds is not None
    np.testing.assert_allclose(seconds, [0.01, 0.01, 0.05, 0.01], atol=1e-6)


@given(
    span_s=st.floats(2e-3, 0.9),
    first_s=st.floats(-0.5, 0.5),
    unit=st.sampled_from([1.0, 1e3, 1e6, 1e9]),
)
def test_the_unit_is_told_by_how_long_a_sweep_lasts(span_s: float, first_s: float, unit: float) -> None:
    times_s = first_s + span_s * np.array([0.0, 0.5, 1.0])
    seconds = seconds_after_stamp(times_s * unit, STAMP_NS)
    assert seconds is not None
    np.testing.assert_allclose(seconds, times_s, atol=1e-6)
