"""Timed poses: interpolation, coverage and path length."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.frontends.measurements import SECOND_NS

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """`stamps_ns` (n,) int64, never decreasing, and the `poses` (n, 3) x, y (m), theta (rad) at these stamps."""

    stamps_ns: Stamps
    poses: Floats

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def at(self, stamps_ns: Stamps) -> Floats:
        """(m, 3) poses at `stamps_ns`, linearly interpolated, theta unwrapped; the first or last pose outside."""
        values = np.c_[self.poses[:, :2], np.unwrap(self.poses[:, 2])]
        own_s, query_s = self.seconds(self.stamps_ns), self.seconds(stamps_ns)
        return np.stack([np.interp(query_s, own_s, values[:, k]) for k in range(3)], axis=1)

    def covers(self, stamps_ns: Stamps, edge_s: float, gap_s: float) -> Flags:
        """(m,) whether a stamp is at most `edge_s` before the first or after the last, and in no gap over `gap_s`."""
        edge_ns, gap_ns = round(edge_s * SECOND_NS), round(gap_s * SECOND_NS)
        inside: Flags = (stamps_ns >= self.stamps_ns[0] - edge_ns) & (stamps_ns <= self.stamps_ns[-1] + edge_ns)
        if len(self) == 1:
            return inside
        after = np.clip(np.searchsorted(self.stamps_ns, stamps_ns), 1, len(self) - 1)
        short: Flags = self.stamps_ns[after] - self.stamps_ns[after - 1] <= gap_ns
        return inside & short

    def nearest_s(self, stamps_ns: Stamps) -> Floats:
        """(m,) seconds between each of `stamps_ns` and the nearest stamp of the trajectory."""
        after = np.searchsorted(self.stamps_ns, stamps_ns)
        gaps = [np.abs(self.stamps_ns[np.clip(after - k, 0, len(self) - 1)] - stamps_ns) for k in (0, 1)]
        return np.asarray(np.minimum(*gaps) / SECOND_NS)

    def path_m(self) -> Floats:
        """(n,) length of the path (m) from the first stamp to each."""
        steps = np.diff(self.poses[:, :2], axis=0)
        return np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])

    def seconds(self, stamps_ns: Stamps) -> Floats:
        """`stamps_ns` (any shape) in seconds since the first stamp."""
        return np.asarray((stamps_ns - self.stamps_ns[0]) / SECOND_NS)
