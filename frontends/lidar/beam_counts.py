"""Counts of beams by their range, compiled: each scan is checked for many faults, and numpy takes passes for each."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


def beams_between(ranges: NDArray[np.float32], low_m: float, high_m: float) -> int:
    """How many of the `ranges` (n,) lie between the two, both excluded."""
    return int(_between(ranges, np.float32(low_m), np.float32(high_m)))


def largest_range(ranges: NDArray[np.float32]) -> tuple[float, int]:
    """The largest finite one of the `ranges` (n,), m, and how many beams have it; -inf and 0 where none is finite."""
    largest_m, beams = _largest(ranges)
    return float(largest_m), int(beams)


@njit(cache=True)
def _between(ranges: NDArray[np.float32], low_m: np.float32, high_m: np.float32) -> int:
    count = 0
    for i in range(ranges.shape[0]):
        count += low_m < ranges[i] < high_m
    return count


@njit(cache=True)
def _largest(ranges: NDArray[np.float32]) -> tuple[np.float32, int]:
    largest_m, beams = np.float32(-np.inf), 0
    for i in range(ranges.shape[0]):
        if largest_m < ranges[i] < np.inf:
            largest_m, beams = ranges[i], 0
        beams += ranges[i] == largest_m
    return largest_m, beams
