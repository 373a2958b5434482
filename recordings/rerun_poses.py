"""The keyframes' poses as believed now."""

import numpy as np
from wayfi.backend.pose2 import Floats, Pose2


class KeyframePoses:
    """Row k is T_map_base of keyframe k; grows with the drive and is replaced as a whole by a correction."""

    def __init__(self) -> None:
        self._rows = np.zeros((64, 3))
        self._n = 0

    def put(self, keyframe: int, T_map_base: Pose2) -> None:
        """The pose of one keyframe; keyframes left out before it stand at its place."""
        if keyframe >= len(self._rows):
            self._rows = np.vstack([self._rows, np.zeros((max(keyframe + 1, len(self._rows)), 3))])
        self._rows[min(self._n, keyframe) : keyframe + 1] = T_map_base.array()
        self._n = max(self._n, keyframe + 1)

    def replace(self, poses: Floats) -> None:
        """All of them, (n, 3)."""
        n = max(self._n, len(poses))
        if n > len(self._rows):
            self._rows = np.vstack([self._rows[: self._n], np.zeros((n, 3))])
        self._rows[: len(poses)] = poses
        self._n = n

    def array(self) -> Floats:
        """(n, 3) x, y, theta in `map`; a view that the next change may alter."""
        return self._rows[: self._n]

    def pose(self, keyframe: int) -> Pose2:
        """T_map_base of one keyframe."""
        return Pose2.of(self._rows[keyframe])

    def __len__(self) -> int:
        return self._n
