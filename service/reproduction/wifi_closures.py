"""Loop closures from sequences of fingerprints: the paper's section III and the first half of its Algorithm 1.

w counts fingerprints, which are single WiFi scans; a window is [j - w/2, j + w/2], cut where the drive begins or ends.
A fingerprint is compared with one earlier fingerprint, the most similar. The paper does not say so, but its times do:
from w = 20 to 120 they grow as for about 2,000 pairs at 0.029 ms for a comparison, while tens of thousands of pairs
pass its thresholds on a drive of this length.
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
    """Relative poses `T_a_b` (m, 3) between the poses `pairs` (m, 2), by index: a, then the later b."""

    pairs: Pairs
    T_a_b: Floats

    def __len__(self) -> int:
        return len(self.pairs)


def candidate_pairs(similarity: Similarities, path_m: Floats) -> Pairs:
    """(m, 2) pairs: each fingerprint with the most similar one at least 50 m of path earlier, if at least 0.3."""
    pairs = []
    for b in range(len(path_m)):
        far = int(np.searchsorted(path_m, path_m[b] - MIN_PATH_M, side="right"))
        if far and similarity[b, a := int(np.argmax(similarity[b, :far]))] >= MIN_SIMILARITY:
            pairs.append((a, b))
    return np.array(pairs, np.int64).reshape(-1, 2)


def sequence_closures(pairs: Pairs, similarity: Similarities, poses: Floats, window: int, neighbours: int) -> Closures:
    """The closures of `pairs` whose sequences fit with a mean residual under 3 m.

    Each fingerprint in a's window is paired with the mean position of its `neighbours` most similar ones in b's window,
    weighted by similarity; positions are from the odometry `poses` (n, 3). The rigid motion between the two sequences
    corrects the pose of b relative to a.
    """
    fits = _fit_all(pairs, similarity, poses, window // 2, neighbours)
    accepted = fits[:, 3] < MAX_RESIDUAL_M
    a, b = poses[pairs[accepted, 0]], poses[pairs[accepted, 1]]
    return Closures(pairs[accepted], between_all(a, compose_all(fits[accepted, :3], b)))


@njit(cache=True)
def _fit_all(pairs: Pairs, similarity: Similarities, poses: Floats, half: int, neighbours: int) -> Floats:
    """(m, 4) x, y, theta of the rigid motion of each pair, and its mean residual, infinite for less than two points."""
    n = poses.shape[0]
    fits = np.empty((pairs.shape[0], 4))
    for p in range(pairs.shape[0]):
        a_low, a_high = max(pairs[p, 0] - half, 0), min(pairs[p, 0] + half + 1, n)
        b_low, b_high = max(pairs[p, 1] - half, 0), min(pairs[p, 1] + half + 1, n)
        source, target = np.empty((a_high - a_low, 2)), np.empty((a_high - a_low, 2))
        count = 0
        for i in range(a_low, a_high):
            position, weight = _mean_position(similarity[i, b_low:b_high], poses[b_low:b_high], neighbours)
            if weight > 0:
                source[count], target[count] = position, poses[i, :2]
                count += 1
        fits[p] = _fit(source[:count], target[:count])
    return fits


@njit(cache=True)
def _mean_position(similarity: Similarities, poses: Floats, neighbours: int) -> tuple[Floats, float]:
    """The mean position (2,) of the most similar fingerprints, weighted by similarity; and the sum of weights."""
    position, weight = np.zeros(2), 0.0
    for j in np.argsort(-similarity, kind="mergesort")[:neighbours]:
        position += similarity[j] * poses[j, :2]
        weight += similarity[j]
    return position / max(weight, 1e-9), weight


@njit(cache=True)
def _fit(source: Floats, target: Floats) -> Floats:
    fit = np.array([0.0, 0.0, 0.0, np.inf])
    if source.shape[0] >= 2:
        fit[:3] = rigid_motion(source, target)
        fit[3] = mean_residual(fit[:3], source, target)
    return fit
