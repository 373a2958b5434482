"""The distance that a similarity of two fingerprints means, learnt from pairs on the robot's own path.

Buildings, receivers and speeds differ in how fast similarity falls with distance, so that it is learnt on each drive.
Over a few metres of path the wheels measure distance well enough whatever their calibration is.
"""

import math
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.wifi.wifi_config import SelfSimilarityConfig

_SIMILARITY_BINS = 50  # of 0.02; finer ones would hold too few pairs and be joined again
_DISTANCE_M = 0.25  # bins of distance; their rounding of 0.25 / sqrt(12) = 0.07 m is small against an rms of 1 m


@dataclass(frozen=True, slots=True)
class Distance:
    """Of pairs of one similarity: the root mean square distance (m), and the share (0 to 1) nearer than `near_m`."""

    rms_m: float
    near: float


class SelfSimilarity:
    """A histogram of the similarity and the distance of pairs on the robot's own path, no further than `reach_m`."""

    def __init__(self, config: SelfSimilarityConfig) -> None:
        self._min_pairs = config.min_pairs
        distances = math.ceil(config.reach_m / _DISTANCE_M)
        self._counts = np.zeros((_SIMILARITY_BINS, distances))
        self._squared_m = ((np.arange(distances) + 0.5) * _DISTANCE_M) ** 2

    def add(self, similarity: Floats, distance_m: Floats) -> None:
        """Add pairs (n,) of the path just driven."""
        row = np.minimum((similarity * _SIMILARITY_BINS).astype(int), _SIMILARITY_BINS - 1)
        column = (distance_m / _DISTANCE_M).astype(int)
        kept = column < self._counts.shape[1]
        np.add.at(self._counts, (row[kept], column[kept]), 1.0)

    def distance(self, similarity: float, near_m: float) -> Distance:
        """The distance that `similarity` means, by the nearest bins with enough pairs; rms inf before there are any."""
        row = min(int(similarity * _SIMILARITY_BINS), _SIMILARITY_BINS - 1)
        counts = self._counts[row]
        for reach in range(1, _SIMILARITY_BINS):
            if counts.sum() >= self._min_pairs:
                return Distance(math.sqrt(counts @ self._squared_m / counts.sum()), _share_near(counts, near_m))
            counts = self._counts[max(row - reach, 0) : row + reach + 1].sum(axis=0)
        return Distance(math.inf, 0.0)


def _share_near(counts: Floats, near_m: float) -> float:
    return float(counts[: round(near_m / _DISTANCE_M)].sum() / counts.sum())
