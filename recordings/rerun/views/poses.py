"""Poses that grow with the drive: the keyframes' as believed now, and others by number."""

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2


class Poses:
    """Row i is the pose of number i; appending is cheap."""

    def __init__(self) -> None:
        self._rows = np.zeros((64, 3))
        self._n = 0

    def put(self, number: int, pose: Pose2) -> None:
        """The pose of one number; numbers left out before it get the same."""
        self._grow(number + 1)
        self._rows[min(self._n, number) : number + 1] = pose.array()
        self._n = max(self._n, number + 1)

    def replace(self, poses: Floats) -> None:
        """The first n of them, (n, 3)."""
        self._grow(len(poses))
        self._rows[: len(poses)] = poses
        self._n = max(self._n, len(poses))

    def array(self) -> Floats:
        """(n, 3) x, y, theta; a view that the next change may alter."""
        return self._rows[: self._n]

    def pose(self, number: int) -> Pose2:
        """The pose of one number."""
        return Pose2.of(self._rows[number])

    def __len__(self) -> int:
        return self._n

    def _grow(self, n: int) -> None:
        if n > len(self._rows):
            self._rows = np.vstack([self._rows, np.zeros((n, 3))])
