"""Follows hypotheses along the local track, and compares the scans on the way with the map."""

import numpy as np

from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.localization.hypotheses import Hypothesis
from wayfi.frontends.localization.local_track import LocalTrack
from wayfi.frontends.localization.localization_config import LocalizationConfig
from wayfi.frontends.localization.map_matching import MapMatcher
from wayfi.frontends.localization.map_places import MapPlaces
from wayfi.frontends.maps.building_map import BuildingMap

FAR_M = 8.0  # from any place of the map: it has no walls to compare with


class Follower:
    """Moves hypotheses to the track's keyframes."""

    def __init__(
        self, building: BuildingMap, track: LocalTrack, lidar: LidarConfig, config: LocalizationConfig
    ) -> None:
        self._track, self._lidar, self._config = track, lidar, config
        self._places = {floor: MapPlaces(building, lidar, config.places, floor) for floor in building.floors}
        self._matcher = MapMatcher(lidar, config.fix)

    def catch_up(self, hypothesis: Hypothesis, most: int) -> int:
        """Follow to the newest keyframe, and compare at most `most` scans on the way; returns how many were."""
        compared = 0
        hypothesis.keyframe = max(hypothesis.keyframe, self._track.oldest)
        while hypothesis.keyframe < self._track.newest and compared < most:
            moved = self._track.step_to(hypothesis.keyframe + 1).moved
            if moved:
                hypothesis.doubt()
            hypothesis.move_to_next(self._track)
            compared += self._compare(hypothesis)
        return compared

    def follow_claim(self, hypothesis: Hypothesis) -> bool:
        """Follow a claimed hypothesis to the newest keyframe; False if the robot was moved, and is not there now.

        Where the local track breaks, a scan that agrees with the map all the same tells that the robot was not moved.
        """
        step = self._track.step_to(self._track.newest)
        tight = hypothesis.covariance.copy()
        hypothesis.move_to_next(self._track)
        if not step.moved:
            self._compare(hypothesis)
            return True
        hypothesis.covariance, agreed = tight, hypothesis.agreed
        hypothesis.doubt()
        self._compare(hypothesis)
        stayed = hypothesis.agreed > 0
        hypothesis.agreed = agreed if stayed else 0
        return stayed

    def _compare(self, hypothesis: Hypothesis) -> int:
        """Compare the scan where the hypothesis is with the map; returns 1 if there was something to compare."""
        track, T = self._track, hypothesis.T_map_base
        scan, claim = track.scan(hypothesis.keyframe), self._config.claim
        places = self._places[hypothesis.floor]
        if scan is None or len(scan.points) < self._lidar.min_points or not len(places):
            return 0
        number, distance_m = places.nearest(np.array([T.x, T.y]))
        if distance_m > FAR_M or not hypothesis.is_new_place(claim):
            return 0
        fix = self._matcher.fix(scan, places.place(number), T, hypothesis.covariance)
        if hypothesis.is_new:
            hypothesis.open_along(fix, self._config.proposals.open_sigma_m)
        hypothesis.update(fix, track.point(hypothesis.keyframe).path_m, claim)
        return 1
