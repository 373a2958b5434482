"""A growing array of poses by number: of keyframes, submaps or fingerprints."""

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2


class Poses:
    """Row i is the pose of number i. Appending takes amortised constant time."""

    def __init__(self) -> None:
        self._rows = np.zeros((64, 3))
        self._n = 0

    def put(self, number: int, pose: Pose2) -> None:
        """Set the pose of `number`; numbers skipped before it get the same pose."""
        self._grow(number + 1)
        self._rows[min(self._n, number) : number + 1] = pose.array()
        self._n = max(self._n, number + 1)

    def replace(self, poses: Floats) -> None:
        """Set the first n poses to `poses` (n, 3)."""
        self._grow(len(poses))
        self._rows[: len(poses)] = poses
        self._n = max(self._n, len(poses))

    def array(self) -> Floats:
        """(n, 3) x, y, theta; a view, which the next change may alter."""
        return self._rows[: self._n]

    def pose(self, number: int) -> Pose2:
        """The pose of `number`."""
        return Pose2.of(self._rows[number])

    def __len__(self) -> int:
        return self._n

    def _grow(self, n: int) -> None:
        if n > len(self._rows):
            self._rows = np.vstack([self._rows, np.zeros((n, 3))])
