"""The compiled counts of beams are those of numpy, also of ranges that are no numbers."""

import numpy as np
import pytest
from numpy.typing import NDArray

from wayfi.frontends.lidar.beam_counts import beams_between, largest_range

SEEN = np.array([0.0, 0.02, 1.0, 5.0, 5.0, 30.0, -1.0, np.inf, np.nan], np.float32)


@pytest.mark.parametrize("low_m", [-2.0, 0.0, 0.02, 5.0])
@pytest.mark.parametrize("high_m", [0.02, 5.0, 30.0, np.inf])
def test_both_ends_are_excluded(low_m: float, high_m: float) -> None:
    expected = (np.float32(low_m) < SEEN) & (np.float32(high_m) > SEEN)
    assert beams_between(SEEN, low_m, high_m) == np.count_nonzero(expected)


@pytest.mark.parametrize(
    ("ranges", "largest_m", "beams"),
    [(SEEN[:5], 5.0, 2), (SEEN, 30.0, 1), (SEEN[-2:], -np.inf, 0), (SEEN[:0], -np.inf, 0)],
)
def test_the_largest_range_is_finite(ranges: NDArray[np.float32], largest_m: float, beams: int) -> None:
    assert largest_range(ranges) == (largest_m, beams)
