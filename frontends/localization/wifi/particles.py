"""Poses that the robot may have, each with its weight, moved by the wheels and drawn anew where they are unlikely.

Nothing is random: noise comes from a fixed low-discrepancy sequence (Roberts, 2018), and particles are drawn by
systematic resampling. So a drive gives the same belief each time.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, compose_all, wrap_all

TABLE = 8191  # a prime: any stride through it meets every entry
STRIDE = 3001  # entries between the noise of two moments: none repeats within some thousand


def spread_evenly(count: int, dimensions: int, first: int = 0) -> Floats:
    """(count, dimensions) numbers in [0, 1) that fill the cube evenly: the sequence's entries from `first` on."""
    ratio = 2.0
    for _ in range(64):
        ratio = (1.0 + ratio) ** (1.0 / (dimensions + 1))  # to the root of x^(d + 1) = x + 1
    steps = ratio ** -np.arange(1.0, dimensions + 1)
    return np.asarray((0.5 + np.outer(np.arange(first + 1, first + count + 1), steps)) % 1.0)


def _standard_normal(count: int) -> Floats:
    """(count, 3) evenly spread standard normal numbers, after Box and Muller (1958)."""
    even = spread_evenly(count, 4)
    radius, angle = np.sqrt(-2.0 * np.log1p(-even[:, [0, 0, 2]])), 2.0 * np.pi * even[:, [1, 1, 3]]
    return np.asarray(radius * np.column_stack([np.cos(angle[:, 0]), np.sin(angle[:, 1]), np.cos(angle[:, 2])]))


class Cloud(NamedTuple):
    """(n, 3) `poses` in map on `floor` (n,), of `weights` (n,)."""

    poses: Floats
    floor: NDArray[np.int64]
    weights: Floats


class Particles:
    """(n, 3) `poses` in map on `floor` (n,), of `weights` (n,); `unknown` is the weight of a place not in the map."""

    def __init__(self, count: int) -> None:
        self.poses = np.zeros((count, 3))
        self.floor = np.zeros(count, np.int64)
        self.weights = np.zeros(count)
        self.unknown = 1.0
        self._noise = _standard_normal(TABLE)
        self._drawn = 0

    def cloud(self) -> Cloud:
        """Those that have any weight, as they are now."""
        kept = self.weights > 0.0
        return Cloud(self.poses[kept], self.floor[kept], self.weights[kept])

    def move(self, step: Pose2, covariance: Floats) -> None:
        """Move all by the wheels' `step`, each with noise of the (3, 3) `covariance` in the axes of base_link."""
        values, vectors = np.linalg.eigh(covariance)
        noise = self._next_noise(len(self.poses)) * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
        self.poses = compose_all(self.poses, step.array() + noise)

    def weigh(self, log_ratio: Floats) -> None:
        """Multiply the weights by exp(`log_ratio`) (n,), against a place that is not in the map; all sum to 1."""
        top = max(float(log_ratio.max(initial=0.0)), 0.0)
        self.weights = self.weights * np.exp(log_ratio - top)
        self.unknown *= float(np.exp(-top))
        total = self.unknown + float(self.weights.sum())
        self.weights, self.unknown = self.weights / total, self.unknown / total

    def draw(self, count: int, roughening_m: float, roughening_rad: float) -> None:
        """Draw `count` of equal weight into the first places, by their weights; the others get no weight."""
        total = float(self.weights.sum())
        if total <= 0.0:
            self.weights[:] = 0.0
            return
        edges = np.cumsum(self.weights) / total
        drawn = np.minimum(np.searchsorted(edges, (np.arange(count) + 0.5) / count), len(edges) - 1)
        noise = self._next_noise(count) * np.array([roughening_m, roughening_m, roughening_rad])
        self.poses[:count] = self.poses[drawn] + noise
        self.poses[:count, 2] = wrap_all(self.poses[:count, 2])
        self.floor[:count] = self.floor[drawn]
        self.weights[:count], self.weights[count:] = total / count, 0.0

    def spread_over(self, floors: Sequence[int]) -> None:
        """The robot may be on any of these floors by now, wherever it is there: each gets as much of the weight."""
        heaviest_first = np.argsort(-self.weights, kind="stable")
        self.floor[heaviest_first] = np.resize(np.array(floors, np.int64), len(self.floor))

    def leave(self, chance: float) -> None:
        """Let the robot leave the map by this chance."""
        self.unknown += chance * float(self.weights.sum())
        self.weights *= 1.0 - chance

    def sow(self, poses: Floats, floor: NDArray[np.int64], weights: Floats, share: float) -> None:
        """Replace the last particles by `poses` (m, 3) on `floor` (m,), which take `share` of the weight of all.

        `weights` (m,) are theirs against even ones, whose sum is 1.
        """
        self.weights *= 1.0 - share
        self.unknown *= 1.0 - share
        sown = slice(len(self.poses) - len(poses), None)
        self.poses[sown], self.floor[sown], self.weights[sown] = poses, floor, share * weights

    def _next_noise(self, count: int) -> Floats:
        """(count, 3) standard normal noise."""
        self._drawn = (self._drawn + STRIDE) % TABLE
        return np.asarray(self._noise[(self._drawn + np.arange(count)) % TABLE])
