"""KISS-ICP's map and scan matching: points in voxels, and point-to-point ICP against them.

Vizzo et al., "KISS-ICP: In Defense of Point-to-Point ICP" (RA-L 2023). Its compiled parts are built from plain values:
its own configuration is read from the environment, which must not decide what an estimate is.
"""

from typing import Any

import numpy as np
from kiss_icp.pybind import kiss_icp_pybind as kiss

from wayfi.backend.pose2 import Floats

# KISS-ICP's own numbers (kiss_icp.py: voxelize, register_frame; config.py: MappingConfig)
MAP_VOXELS, KEYPOINT_VOXELS = 0.5, 1.5  # side of the voxels that are left one point each: for the map, for matching
GATE_KERNELS = 3  # the widest gate of a correspondence, in scales of the kernel
POINTS_PER_VOXEL = 20
THREADS = 1  # the sums of several threads depend on their order


class VoxelMap:
    """The points of the last scans, as far as `max_range_m` from the newest; can be pickled."""

    def __init__(self, voxel_m: float, max_range_m: float, iterations: int, settled: float) -> None:
        self._settings = voxel_m, max_range_m, iterations, settled
        self._voxel_m = voxel_m
        self._map = kiss._VoxelHashMap(voxel_m, max_range_m, POINTS_PER_VOXEL)
        self._icp = kiss._Registration(iterations, settled, THREADS)

    def __getstate__(self) -> dict[str, Any]:
        """The settings and the points: KISS-ICP's own objects cannot be pickled."""
        return {"settings": self._settings, "points": self.points()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a map of the same points."""
        self.__init__(*state["settings"])  # type: ignore[misc]
        self._map._add_points(_vectors(state["points"]))

    @property
    def empty(self) -> bool:
        """Whether it holds no points."""
        return bool(self._map._empty())

    def points(self) -> Floats:
        """(p, 3) points of the map, m."""
        return np.asarray(self._map._point_cloud()).reshape(-1, 3)

    def thinned(self, points: Floats) -> Floats:
        """(m, 3) of the points (n, 3) m, one in each half voxel: those to add to the map."""
        return _one_in_each_voxel(points, MAP_VOXELS * self._voxel_m)

    def keypoints(self, thinned: Floats) -> Floats:
        """(k, 3) of the thinned points (m, 3), one in each 1.5 voxels: those to match."""
        return _one_in_each_voxel(thinned, KEYPOINT_VOXELS * self._voxel_m)

    def align(self, keypoints: Floats, guess: Floats, kernel_m: float) -> Floats:
        """(4, 4) pose in the map of keypoints (k, 3) m, from `guess` (4, 4); the guess itself where nothing overlaps.

        `kernel_m` is the scale of the kernel, as far as the guess may be off.
        """
        gate_m = GATE_KERNELS * kernel_m
        return np.asarray(self._icp._align_points_to_map(_vectors(keypoints), self._map, guess, gate_m, kernel_m))

    def add(self, thinned: Floats, T_map_base: Floats) -> None:
        """Add thinned points (m, 3) at a pose (4, 4), and remove those that are out of range from there."""
        self._map._update(_vectors(thinned), T_map_base)

    def clear(self) -> None:
        """Remove all points."""
        self._map._clear()


def _one_in_each_voxel(points: Floats, voxel_m: float) -> Floats:
    return np.asarray(kiss._voxel_down_sample(_vectors(points), voxel_m))


def _vectors(points: Floats) -> Any:  # noqa: ANN401 - compiled code without types
    return kiss._Vector3dVector(points)
