"""Proposes where the robot may be: the last scans are searched for where WiFi puts it, or in the whole map."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.localization.local_track import LocalTrack
from wayfi.frontends.localization.localization_config import LocalizationConfig
from wayfi.frontends.localization.map_search import MapSearch, Region
from wayfi.frontends.localization.wifi_support import WifiSupport
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.scan_points import ScanPoints


@dataclass(frozen=True, slots=True)
class Proposed:
    """A pose on a floor of the map that was proposed for the local `keyframe`."""

    T_map_base: Pose2
    keyframe: int
    floor: int


class Proposals:
    """Searches one after the other, each in slices.

    `complete`: the last search that ended has left out no place where the robot may be.
    """

    def __init__(
        self, building: BuildingMap, track: LocalTrack, lidar: LidarConfig, config: LocalizationConfig
    ) -> None:
        self._track, self._config, self._least_points = track, config.proposals, lidar.min_points
        self._searches = {floor: MapSearch(building, config.search, floor) for floor in building.floors}
        self._floor = 0  # that is searched
        self._regions: deque[tuple[int, Region | None]] = deque()
        self._everywhere = False  # whether the search that was begun last is of the whole map
        self._least_in_map = config.claim.least_in_map
        self._scans: tuple[list[ScanPoints], Floats] = [], np.empty((0, 3))
        self._keyframe = -1
        self._complete_so_far = True
        self.complete = False
        self.restart()

    def restart(self) -> None:
        """Forget what was searched: the robot may be anywhere."""
        self._regions.clear()
        self._running, self.complete = False, False
        self._due = True

    @property
    def running(self) -> bool:
        """Whether a search goes on."""
        return self._running

    def narrow(self, wifi: WifiSupport) -> None:
        """Give up a search of the whole map as soon as WiFi tells which part of it the robot is in."""
        if self._everywhere and self._running and wifi.known and wifi.weight >= self._least_in_map:
            self.restart()

    def begin(self, wifi: WifiSupport) -> bool:
        """Begin a search by the newest scans, if one is due; False if not."""
        if self._running or self._track.newest < 0:
            return False
        scan = self._track.scan(self._track.newest)
        self._due = self._due or self._sees_more()
        if not self._due or scan is None or len(scan.points) < self._least_points:
            return False
        self._due, self._keyframe = False, self._track.newest
        self._scans = self._track.last_scans(self._config.scans, self._config.apart_m, self._config.reach_m)
        self._regions = deque(self._regions_of(wifi))
        self._everywhere = any(region is None for _, region in self._regions)
        self._complete_so_far = True
        self._begin_next()
        return self._running

    def _sees_more(self) -> bool:
        """Whether the robot has moved on since the last search; a turn of 1 rad counts as 1 m, for it shows as much."""
        track = self._track
        path_m = track.point(track.newest).path_m - track.point(max(self._keyframe, track.oldest)).path_m
        turned = abs(track.between(self._keyframe, track.newest).theta)
        return path_m + turned >= self._config.again_m

    def go_on(self) -> list[Proposed]:
        """Search on by one slice; returns the poses that it ends with, if it does."""
        result = self._searches[self._floor].go_on(self._config.work)
        if result is None:
            return []
        self._complete_so_far &= result.complete
        proposed = [Proposed(place.T_map_base, self._keyframe, self._floor) for place in result.places]
        self._begin_next()
        if not self._running:
            self.complete = self._complete_so_far
        return proposed

    def _begin_next(self) -> None:
        self._running = False
        while self._regions and not self._running:
            self._floor, region = self._regions.popleft()
            self._running = self._searches[self._floor].begin(*self._scans, region)

    def _regions_of(self, wifi: WifiSupport) -> list[tuple[int, Region | None]]:
        """The floors and regions where WiFi puts the robot, the likeliest first; the whole map where it names none."""
        if not wifi.known or wifi.weight < self._least_in_map:
            return [(floor, None) for floor in self._searches]
        regions: list[tuple[int, Region | None]] = []
        weight = 0.0
        for place in wifi.places[: self._config.wifi_places]:
            if weight >= self._config.wifi_weight * wifi.weight:
                break
            weight += place.weight
            sigma_m = float(np.sqrt(np.linalg.eigvalsh(place.covariance[:2, :2])[-1]))
            region = Region(place.T_map_base.x, place.T_map_base.y, self._config.wifi_sigmas * sigma_m)
            regions.append((place.floor, region))
        return regions
