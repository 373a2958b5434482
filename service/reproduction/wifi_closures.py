"""Loop closures from sequences of fingerprints: the paper's section III and the first half of its Algorithm 1.

w counts fingerprints, which are single WiFi scans; a window is [j - w/2, j + w/2], cut where the drive begins or ends.
A fingerprint is outcome against one earlier one, the most similar. The paper does not say so, but its seconds do: from
w = 20 to 120 they grow as the comparisons of some 2,000 pairs would, at its 0.029 ms each, while tens of thousands pass
its thresholds on a drive of that length.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, between_all, compose_all
from wayfi.service.reproduction.rigid_motion import mean_residual, rigid_motion
from wayfi.service.reproduction.similarities import Similarities

MIN_PATH_M = 50.0
MIN_SIMILARITY = 0.3
MAX_RESIDUAL_M = 3.0

Pairs = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Closures:
    """Relative poses `T_a_b` (m, 3) between poses `pairs` (m, 2) by number: a, then the later b."""

    pairs: Pairs
    T_a_b: Floats

    def __len__(self) -> int:
        return len(self.pairs)


def candidate_pairs(similarity: Similarities, path_m: Floats) -> Pairs:
    """(m, 2) fingerprints: each with the most similar one 50 m of path or more before it, if it is 0.3 or more."""
    pairs = []
    for b in range(len(path_m)):
        far = int(np.searchsorted(path_m, path_m[b] - MIN_PATH_M, side="right"))
        if far and similarity[b, a := int(np.argmax(similarity[b, :far]))] >= MIN_SIMILARITY:
            pairs.append((a, b))
    return np.array(pairs, np.int64).reshape(-1, 2)


def sequence_closures(pairs: Pairs, similarity: Similarities, poses: Floats, window: int, neighbours: int) -> Closures:
    """The closures of `pairs` whose sequences fit: mean residual under 3 m.

    Each fingerprint of a's window is paired with the mean place of its `neighbours` most similar ones of b's, weighted
    by similarity. What lays these over a's, all where the odometry `poses` (n, 3) have them, moves b to where it was.
    """
    fits = _fit_all(pairs, similarity, poses, window // 2, neighbours)
    accepted = fits[:, 3] < MAX_RESIDUAL_M
    a, b = poses[pairs[accepted, 0]], poses[pairs[accepted, 1]]
    return Closures(pairs[accepted], between_all(a, compose_all(fits[accepted, :3], b)))


@njit(cache=True)
def _fit_all(pairs: Pairs, similarity: Similarities, poses: Floats, half: int, neighbours: int) -> Floats:
    """(m, 4) x, y, theta of the motion that each pair asks for, and its mean residual; infinite without two places."""
    n = poses.shape[0]
    fits = np.empty((pairs.shape[0], 4))
    for p in range(pairs.shape[0]):
        a_low, a_high = max(pairs[p, 0] - half, 0), min(pairs[p, 0] + half + 1, n)
        b_low, b_high = max(pairs[p, 1] - half, 0), min(pairs[p, 1] + half + 1, n)
        source, target = np.empty((a_high - a_low, 2)), np.empty((a_high - a_low, 2))
        count = 0
        for i in range(a_low, a_high):
            place, weight = _mean_place(similarity[i, b_low:b_high], poses[b_low:b_high], neighbours)
            if weight > 0:
                source[count], target[count] = place, poses[i, :2]
                count += 1
        fits[p] = _fit(source[:count], target[:count])
    return fits


@njit(cache=True)
def _mean_place(similarity: Similarities, poses: Floats, neighbours: int) -> tuple[Floats, float]:
    """(2,) mean place of the most similar ones, weighted by similarity; and the sum of weights."""
    place, weight = np.zeros(2), 0.0
    for j in np.argsort(-similarity, kind="mergesort")[:neighbours]:
        place += similarity[j] * poses[j, :2]
        weight += similarity[j]
    return place / max(weight, 1e-9), weight


@njit(cache=True)
def _fit(source: Floats, target: Floats) -> Floats:
    fit = np.array([0.0, 0.0, 0.0, np.inf])
    if source.shape[0] >= 2:
        fit[:3] = rigid_motion(source, target)
        fit[3] = mean_residual(fit[:3], source, target)
    return fit
