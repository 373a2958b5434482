"""The places of a map, a few metres apart: the scans of the keyframes around each, ready to match with."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, between_all
from wayfi.frontends.lidar.correlative import LikelihoodField, build_field
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.point_index import PointIndex
from wayfi.frontends.lidar.scan_matching import merge_submap
from wayfi.frontends.localization.localization_config import MapPlacesConfig
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.scan_points import ScanPoints


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A place of the map at `T_map_place`: its `scans` at (n, 3) `poses` in its frame, their index and field."""

    T_map_place: Pose2
    scans: Sequence[ScanPoints]
    poses: Floats
    walls: PointIndex
    field: LikelihoodField


class MapPlaces:
    """The places of a floor by number; what is matched with is made when it is needed, and the last used are kept."""

    def __init__(self, building: BuildingMap, lidar: LidarConfig, config: MapPlacesConfig, floor: int = 0) -> None:
        self._lidar, self._config = lidar, config
        usable = [
            k
            for k, keyframe in enumerate(building.keyframes)
            if keyframe.floor == floor
            and keyframe.scan is not None
            and len(keyframe.scan.points) >= lidar.min_points
            and np.isfinite(building.poses[k]).all()
        ]
        self._scans = [scan for k in usable if (scan := building.keyframes[k].scan) is not None]
        self._poses = np.asarray(building.poses[usable], np.float64).reshape(-1, 3)
        self._middles = np.array(_spread(self._poses, config.apart_m, 0.0, len(usable)), np.intp)
        self._kept: OrderedDict[int, Place] = OrderedDict()

    def __getstate__(self) -> dict[str, Any]:
        """Everything but what can be made again."""
        return vars(self) | {"_kept": OrderedDict()}

    def __len__(self) -> int:
        return len(self._middles)

    @property
    def poses(self) -> Floats:
        """(n, 3) where the places are, in `map`."""
        return self._poses[self._middles]

    def distances(self, xy: Floats) -> Floats:
        """(n,) m from `xy` (2,) to each place."""
        return np.asarray(np.hypot(*(self.poses[:, :2] - xy).T))

    def nearest(self, xy: Floats) -> tuple[int, float]:
        """The place nearest to `xy` (2,), and its distance (m). There must be one."""
        distances = self.distances(xy)
        number = int(np.argmin(distances))
        return number, float(distances[number])

    def place(self, number: int) -> Place:
        """A place by its number."""
        place = self._kept.pop(number, None) or self._make(number)
        self._kept[number] = place
        if len(self._kept) > self._config.kept:
            self._kept.popitem(last=False)
        return place

    def _make(self, number: int) -> Place:
        config, middle = self._config, self._poses[self._middles[number]]
        distances = np.hypot(*(self._poses[:, :2] - middle[:2]).T)
        near: NDArray[np.intp] = np.flatnonzero(distances <= config.radius_m)
        near = near[np.argsort(distances[near], kind="stable")]
        chosen = near[_spread(self._poses[near], config.spacing_m, config.turn_cost_m_per_rad, config.keyframes)]
        scans, poses = [self._scans[k] for k in chosen], between_all(middle, self._poses[chosen])
        walls = merge_submap(scans, poses, self._lidar.cell_m)
        assert walls is not None
        return Place(Pose2.of(middle), scans, poses, walls, build_field(walls.points, self._lidar.correlative))


def _spread(poses: Floats, apart_m: float, turn_cost_m_per_rad: float, most: int) -> list[int]:
    """The numbers of up to `most` of (n, 3) poses, in their order, each `apart_m` or more from those before."""
    chosen: list[int] = []
    for number, pose in enumerate(poses):
        if len(chosen) == most:
            break
        T = between_all(pose, poses[chosen]) if chosen else np.empty((0, 3))
        if (np.hypot(T[:, 0], T[:, 1]) + turn_cost_m_per_rad * np.abs(T[:, 2]) >= apart_m).all():
            chosen.append(number)
    return chosen
