"""KISS-ICP's local map and registration, for a robot that stays on level ground: poses go in and come out in SE(2).

Vizzo et al., "KISS-ICP: In Defense of Point-to-Point ICP" (RA-L 2023). Its parts are used rather than its whole, so
that the wheels give the first guess (as in Guadagnino et al., "Kinematic-ICP", ICRA 2025), and so that no tilt builds
up: the pose is put back into the plane before its points join the map.
"""

import math
from typing import Any

import numpy as np
from kiss_icp.config.parser import load_config
from kiss_icp.mapping import get_voxel_hash_map
from kiss_icp.registration import get_registration
from kiss_icp.voxelization import voxel_down_sample

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.lidar_config import CloudConfig

# KISS-ICP's own ratios (kiss_icp.py: voxelize, register_frame): voxels to map and to register, and the widest gate.
MAP_VOXELS, KEYPOINT_VOXELS, GATE_KERNELS = 0.5, 1.5, 3


class CloudMap:
    """The points of the last clouds around the robot."""

    def __init__(self, config: CloudConfig, max_range_m: float) -> None:
        self._config = config
        self._max_range_m = max_range_m
        self._create()
        self._middle = np.array([0.0, 0.0, 0.5 * (config.low_m + config.high_m)])

    def __getstate__(self) -> dict[str, Any]:
        """All but KISS-ICP's own objects, which cannot be pickled: in their place the points."""
        state = {name: value for name, value in vars(self).items() if name not in ("_map", "_registration")}
        return state | {"points": self.points()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """A map of the same points."""
        points = state.pop("points")
        vars(self).update(state)
        self._create()
        self._map.add_points(points)

    def _create(self) -> None:
        kiss = load_config(None)
        kiss.data.max_range = self._max_range_m
        kiss.mapping.voxel_size = self._config.voxel_m
        kiss.registration.max_num_threads = 1
        kiss.registration.max_num_iterations = self._config.iterations
        kiss.registration.convergence_criterion = self._config.settled
        self._map = get_voxel_hash_map(kiss)
        self._registration = get_registration(kiss)

    @property
    def empty(self) -> bool:
        """Whether it holds no points."""
        return bool(self._map.empty())

    def thinned(self, points: Floats) -> Floats:
        """(m, 3) of the band's points (n, 3) m in base_link, one in each half voxel, heights from the band's middle.

        With heights about the middle, the little roll and pitch that the registration finds does not shift x and y.
        """
        return np.asarray(voxel_down_sample(points - self._middle, MAP_VOXELS * self._config.voxel_m))

    def keypoints(self, thinned: Floats) -> Floats:
        """(k, 3) of the thinned points (m, 3), one in each 1.5 voxels: those to register."""
        return np.asarray(voxel_down_sample(thinned, KEYPOINT_VOXELS * self._config.voxel_m))

    def align(self, keypoints: Floats, guess: Pose2) -> Pose2:
        """T_map_base of keypoints (k, 3) m, from `guess`; the guess itself where nothing overlaps."""
        kernel_m = self._config.kernel_m
        gate_m = GATE_KERNELS * kernel_m
        T = self._registration.align_points_to_map(keypoints, self._map, _spatial(guess), gate_m, kernel_m)
        return Pose2.in_plane(T)

    def add(self, thinned: Floats, T_map_base: Pose2) -> None:
        """Add thinned points (m, 3) at a pose, and remove those that are out of range from there."""
        self._map.update(thinned, _spatial(T_map_base))

    def clear(self) -> None:
        """Remove all points."""
        self._map.clear()

    def points(self) -> Floats:
        """(p, 3) points of the map, m."""
        return np.asarray(self._map.point_cloud()).reshape(-1, 3)


def _spatial(T: Pose2) -> Floats:
    """(4, 4) of a pose in the plane."""
    c, s = math.cos(T.theta), math.sin(T.theta)
    return np.array([[c, -s, 0.0, T.x], [s, c, 0.0, T.y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
