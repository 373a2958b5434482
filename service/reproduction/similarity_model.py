"""The similarity model that the paper compares with: distance and sigma as functions of similarity, in bins.

After Liu et al. (arXiv 1904.11712): the model is learnt from pairs at short path distance, where the odometry is
accurate. A closure gives the distance between two fingerprints, without direction.
"""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.service.reproduction.errors import ReproductionError
from wayfi.service.reproduction.similarities import Similarities
from wayfi.service.reproduction.wifi_closures import Pairs

SHORT_PATH_M = 20.0
BINS = 20
MIN_PAIRS_IN_BIN = 10
MIN_SIGMA_M = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class SimilarityModel:
    """`distance_m` (m,) between fingerprints of `similarity` (m,), which ascends, and its `sigma_m` (m,)."""

    similarity: Floats
    distance_m: Floats
    sigma_m: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Distances:
    """`distance_m` (m,) between poses `pairs` (m, 2), by index, with standard deviation `sigma_m` (m,)."""

    pairs: Pairs
    distance_m: Floats
    sigma_m: Floats


def learn_model(similarity: Similarities, poses: Floats, path_m: Floats) -> SimilarityModel:
    """The mean and spread of the odometry's distances between fingerprints up to 20 m of path apart, in bins of 0.05.

    Raises ReproductionError if no bin has enough pairs.
    """
    similar, distance = [], []
    for i in range(len(path_m)):
        end = int(np.searchsorted(path_m, path_m[i] + SHORT_PATH_M, side="right"))
        similar.append(similarity[i, i + 1 : end])
        distance.append(np.hypot(*(poses[i + 1 : end, :2] - poses[i, :2]).T))
    return _in_bins(np.concatenate(similar), np.concatenate(distance))


def distance_closures(pairs: Pairs, similarity: Similarities, model: SimilarityModel) -> Distances:
    """The distances of `pairs` according to the model, interpolated between the middles of the bins."""
    values = similarity[pairs[:, 0], pairs[:, 1]]
    distance, sigma = (np.interp(values, model.similarity, column) for column in (model.distance_m, model.sigma_m))
    return Distances(pairs, distance, sigma)


def _in_bins(similarity: Similarities, distance_m: Floats) -> SimilarityModel:
    numbers = np.minimum((similarity * BINS).astype(np.int64), BINS - 1)
    filled = np.flatnonzero(np.bincount(numbers, minlength=BINS) >= MIN_PAIRS_IN_BIN)
    if len(filled) == 0:
        raise ReproductionError("too few WiFi scans to learn how similarity falls with distance")
    groups = [distance_m[numbers == number] for number in filled]
    spread = np.array([group.std() for group in groups])
    middles = (filled + 0.5) / BINS
    return SimilarityModel(middles, np.array([g.mean() for g in groups]), np.maximum(spread, MIN_SIGMA_M))
