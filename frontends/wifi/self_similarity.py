"""How far apart two fingerprints are that sound so alike: learnt from the robot's own path, where the wheels know.

Buildings, receivers and speeds differ in how fast the radio fades with distance; a similarity means a distance only
where it was heard. Over a few metres of path the wheels are right whatever their calibration is.
"""

import math
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats

REACH_M = 12.0  # further apart than this, similarity says nothing more, and the wheels begin to err
_SIMILARITY_BINS = 50
_DISTANCE_M = 0.25
_PAIRS = 100  # at the least, of about one similarity: fewer make a poor mean


@dataclass(frozen=True, slots=True)
class Distance:
    """What a similarity says: the root mean square distance (m), and the share of pairs nearer than was asked."""

    rms_m: float
    near: float


class SelfSimilarity:
    """A histogram of the similarity and the distance of pairs on the robot's own path, no further than `REACH_M`."""

    def __init__(self, near_m: float) -> None:
        self._near = round(near_m / _DISTANCE_M)
        distances = math.ceil(REACH_M / _DISTANCE_M)
        self._counts = np.zeros((_SIMILARITY_BINS, distances))
        self._squared_m = ((np.arange(distances) + 0.5) * _DISTANCE_M) ** 2

    def add(self, similarity: Floats, distance_m: Floats) -> None:
        """Take in pairs (n,) of the path just driven."""
        row = np.minimum((similarity * _SIMILARITY_BINS).astype(int), _SIMILARITY_BINS - 1)
        column = (distance_m / _DISTANCE_M).astype(int)
        kept = column < self._counts.shape[1]
        np.add.at(self._counts, (row[kept], column[kept]), 1.0)

    def distance(self, similarity: float) -> Distance:
        """What is known of two fingerprints of this similarity; nothing (infinitely far) before enough was learnt."""
        row = min(int(similarity * _SIMILARITY_BINS), _SIMILARITY_BINS - 1)
        counts = self._counts[row]
        for reach in range(1, _SIMILARITY_BINS):
            if counts.sum() >= _PAIRS:
                return Distance(math.sqrt(counts @ self._squared_m / counts.sum()), self._share_near(counts))
            counts = self._counts[max(row - reach, 0) : row + reach + 1].sum(axis=0)
        return Distance(math.inf, 0.0)

    def _share_near(self, counts: Floats) -> float:
        return float(counts[: self._near].sum() / counts.sum())
