"""KISS-ICP's local map, for a robot that stays on level ground: poses go in and come out in SE(2).

Its parts are used rather than its whole, so that the wheels give the first guess (as in Guadagnino et al.,
"Kinematic-ICP", ICRA 2025), and so that no tilt builds up: the pose is put back into the plane before its points join
the map.
"""

import math

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.lidar_config import CloudConfig
from wayfi.frontends.lidar.voxel_map import VoxelMap


class CloudMap:
    """The points of the last clouds around the robot."""

    def __init__(self, config: CloudConfig, max_range_m: float) -> None:
        self._kernel_m = config.kernel_m
        self._map = VoxelMap(config.voxel_m, max_range_m, config.iterations, config.settled)
        self._middle = np.array([0.0, 0.0, 0.5 * (config.low_m + config.high_m)])

    @property
    def empty(self) -> bool:
        """Whether it holds no points."""
        return self._map.empty

    def thinned(self, points: Floats) -> Floats:
        """(m, 3) of the band's points (n, 3) m in base_link, one in each half voxel, heights from the band's middle.

        With heights about the middle, the little roll and pitch that KISS-ICP finds does not shift x and y.
        """
        return self._map.thinned(points - self._middle)

    def keypoints(self, thinned: Floats) -> Floats:
        """(k, 3) of the thinned points (m, 3), one in each 1.5 voxels: those to match."""
        return self._map.keypoints(thinned)

    def align(self, keypoints: Floats, guess: Pose2) -> Pose2:
        """T_map_base of keypoints (k, 3) m, from `guess`; the guess itself where nothing overlaps."""
        return Pose2.in_plane(self._map.align(keypoints, _spatial(guess), self._kernel_m))

    def add(self, thinned: Floats, T_map_base: Pose2) -> None:
        """Add thinned points (m, 3) at a pose, and remove those that are out of range from there."""
        self._map.add(thinned, _spatial(T_map_base))

    def clear(self) -> None:
        """Remove all points."""
        self._map.clear()

    def points(self) -> Floats:
        """(p, 3) points of the map, m."""
        return self._map.points()


def _spatial(T: Pose2) -> Floats:
    """(4, 4) of a pose in the plane."""
    c, s = math.cos(T.theta), math.sin(T.theta)
    return np.array([[c, -s, 0.0, T.x], [s, c, 0.0, T.y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
