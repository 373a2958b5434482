"""A stream that goes on in the map it has made: from making a map to localising in it, and back."""

from dataclasses import replace

import numpy as np

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import Event, StateChanged, Warned
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.modes.continued_slam import ContinuedSlam
from wayfi.frontends.modes.localization_core import LocalizationCore
from wayfi.frontends.odometry.live_pose import EstimateSchedule
from wayfi.frontends.odometry.pose_publisher import PosePublisher
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.result import DriveEstimate
from wayfi.frontends.scan_corrections import ScanCorrections
from wayfi.frontends.slam_config import SlamConfig
from wayfi.frontends.timer import Timer


class SwitchingPipeline(Pipeline):
    """A drive in one or several parts, each of which makes the map or `localises` in what the one before has made.

    The poses of a part stay as they were estimated at its end.
    """

    def __init__(
        self,
        config: SlamConfig,
        calibration: Calibration | None = None,
        timer: Timer | None = None,
        building: BuildingMap | None = None,
        extends: bool = False,
    ) -> None:
        super().__init__(config, calibration, timer, building, extends)
        self.localises = building is not None and not extends
        self._ended: list[DriveEstimate] = []

    def switch(self, localises: bool) -> list[Event]:
        """Localise from now on in the map made so far, or go on making it; a pose that is claimed stays so."""
        latest = self._path.latest
        if localises == self.localises:
            return []
        if latest is None or not self._core.keyframe_count:
            return [Warned(self.stamp_ns, "the mode stays as it is: there is nothing of a map yet")]
        anchor, floor = self._core.anchor(), self._core.floor
        ended, events = self._core.finish(self._publisher.trajectories)
        self._ended.append(ended)
        self.localises = localises
        kind = LocalizationCore if localises else ContinuedSlam
        core = kind(self._config, ended.building.calibration, self._timer, ended.building)
        self._begin_part(core)
        begun = core.add_keyframe(latest, None)
        if anchor is None:
            return events + begun
        now = anchor.pose_at(latest, latest.T_path_base, self._config.odometry)
        known = core.take_over(latest.stamp_ns, now.T_map_base, now.covariance, floor or 0)
        return [*events, *(event for event in begun if not isinstance(event, StateChanged)), *known]

    def finish(self) -> tuple[DriveEstimate, list[Event]]:
        """End the drive; returns its parts as one, with the map of the last."""
        last, events = super().finish()
        parts = [*self._ended, last]
        stamps_ns = np.concatenate([part.stamps_ns for part in parts])
        final = np.concatenate([part.final for part in parts])
        online = np.concatenate([part.online for part in parts])
        floors = np.concatenate([part.floors for part in parts])
        return replace(last, stamps_ns=stamps_ns, final=final, online=online, floors=floors), events

    def _begin_part(self, core: LocalizationCore | ContinuedSlam) -> None:
        self._core = core
        self._corrections = ScanCorrections(self._config.lidar, self._scans, core)
        self._publisher = PosePublisher(self._config.odometry)
        self._last_scan_path_m = -np.inf
        self._estimates = EstimateSchedule(keyframes=-1)
