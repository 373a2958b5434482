"""The bounded search of proposed places: where does one scan fit around them, at any heading? Done in slices."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.correlative import SearchWindow, search
from wayfi.frontends.lidar.icp import icp
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.relocation import any_heading
from wayfi.frontends.localization.hypotheses import is_same
from wayfi.frontends.localization.localization_config import PlaceSearchConfig
from wayfi.frontends.localization.map_matching import Fix, MapMatcher
from wayfi.frontends.localization.map_places import MapPlaces
from wayfi.frontends.scan_points import ScanPoints

ONE_POSE_M, ONE_POSE_RAD = 0.4, 0.15  # nearer than this, two poses that a search finds are one


@dataclass(frozen=True, slots=True)
class _Part:
    place: int
    heading: float


class PlaceSearch:
    """One search of the scan of the local `keyframe`, at the `places` of a map by their numbers."""

    def __init__(
        self,
        keyframe: int,
        scan: ScanPoints,
        places: Sequence[int],
        known: MapPlaces,
        matcher: MapMatcher,
        lidar: LidarConfig,
        config: PlaceSearchConfig,
    ) -> None:
        self.keyframe = keyframe
        self._scan, self._known, self._matcher, self._lidar, self._config = scan, known, matcher, lidar, config
        headings = [2 * math.pi * k / config.headings for k in range(config.headings)]
        self._parts = deque(_Part(place, heading) for place in places for heading in headings)
        self.found: list[Fix] = []

    @property
    def done(self) -> bool:
        """Whether all places have been searched."""
        return not self._parts

    def go_on(self) -> None:
        """Search the next part: one place, and a part of the headings."""
        part = self._parts.popleft()
        place, config, lidar = self._known.place(part.place), self._config, self._lidar
        window = SearchWindow(config.window_m, math.pi / config.headings, np.zeros((3, 3)), np.inf)
        heading = part.heading - place.T_map_place.theta
        grid = any_heading(lidar.relocation, lidar.correlative)
        peak = search(self._scan.points, place.field, Pose2(0.0, 0.0, heading), window, grid)
        result = icp(self._scan, place.walls, peak.pose, np.zeros((3, 3)), lidar.icp)
        if result.inlier_ratio < 0.4:
            return
        fix = self._matcher.as_fix(self._scan, place, result)
        if fix.fit >= config.min_fit and fix.seen_through <= 0.5:
            self._add(fix)

    def _add(self, fix: Fix) -> None:
        for k, other in enumerate(self.found):
            if is_same(fix.T_map_base, other.T_map_base, ONE_POSE_M, ONE_POSE_RAD):
                if fix.fit > other.fit:
                    self.found[k] = fix
                return
        self.found.append(fix)


def places_around(known: MapPlaces, xy: Floats, radius_m: float, most: int) -> list[int]:
    """The numbers of up to `most` places within `radius_m` of `xy` (2,), the nearest first."""
    distances = known.distances(xy)
    order = np.argsort(distances, kind="stable")[:most]
    return [int(k) for k in order if distances[k] <= radius_m]
