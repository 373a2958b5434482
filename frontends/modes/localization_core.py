"""Localisation in a known map, where the pipeline has SLAM else: nothing is added to the map, and no graph grows."""

from typing import NamedTuple

import numpy as np

from wayfi.backend.graph.health import Health, State
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.closures.vetoes import VetoError
from wayfi.frontends.event_making import grid_event, points_of
from wayfi.frontends.events import Event, FloorChanged, HypothesesFollowed, StateChanged
from wayfi.frontends.floors.elevator_watch import ElevatorWatch
from wayfi.frontends.intake.pose_intake import PlacedPose
from wayfi.frontends.localization.local_track import LocalTrack
from wayfi.frontends.localization.localizer import Localizer
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.odometry.live_pose import Anchor
from wayfi.frontends.odometry.trajectories import Trajectories
from wayfi.frontends.result import DriveEstimate, floors_at
from wayfi.frontends.scan_points import PlacedScan
from wayfi.frontends.slam_config import SlamConfig
from wayfi.frontends.step_matcher import StepMatcher
from wayfi.frontends.timer import Timer
from wayfi.frontends.wifi.readings import PlacedWifiScan

UNKNOWN_COVARIANCE = np.diag([0.25, 0.25, 0.0685])  # of a pose from outside: what RViz says of a click, m^2 and rad^2


class FoundPose(NamedTuple):
    """The pose in `map` of a keyframe of the drive, its (3, 3) covariance there, and its floor."""

    keyframe: int
    T_map_base: Pose2
    covariance: Floats
    floor: int


class LocalizationCore:
    """The state of localisation in the map `building`; its memory is bounded however long it goes on."""

    def __init__(self, config: SlamConfig, prior: Calibration, timer: Timer, building: BuildingMap) -> None:
        self._building, self._timer = building, timer
        self._track = LocalTrack(config.lidar, config.odometry, prior.wheels.values)
        self._localizer = Localizer(building, self._track, config.lidar, config.localization)
        self._elevators = ElevatorWatch(len(building.floors), config.floors, config.wifi.similarity_sigma_db)
        self._told: Health | None = None
        self._floor: int | None = 0  # as told last
        self._floors: list[tuple[int, int]] = []  # since when the robot has been on each

    @property
    def steps(self) -> StepMatcher:
        """What matches the scans of one step."""
        return self._track.steps

    @property
    def found(self) -> FoundPose | None:
        """Where the robot is in the map, if that is known without a doubt."""
        pose, floor = self._localizer.pose(), self._localizer.floor
        if pose is None or floor is None or self._localizer.health.state is not State.TRACKING:
            return None
        return FoundPose(*pose, floor)

    @property
    def keyframe_count(self) -> int:
        """How many keyframes there have been."""
        return len(self._track)

    @property
    def floor(self) -> int | None:
        """The floor of the map on which the robot is; None while that is not known."""
        return self._localizer.floor

    def motion_to(self, point: PathPoint) -> WheelMotion:
        """The wheels' motion from the newest keyframe to `point`."""
        return self._track.motion_to(point)

    def anchor(self) -> Anchor | None:
        """The newest keyframe as the anchor of poses since then; None while the pose is not claimed."""
        claimed, track = self._localizer.pose(), self._track
        if claimed is None:
            return None
        keyframe, T_map_base, covariance = claimed
        state, scale = self._localizer.health.state, track.steps.covariance_scale
        return Anchor(track.point(keyframe), T_map_base, covariance, track.calibration, scale, state)

    def add_pose(self, placed: PlacedPose) -> list[Event]:
        """Follow a pose from outside as one more hypothesis, from the newest keyframe on: evidence decides on it."""
        T_map_keyframe = placed.T_map_base @ self.motion_to(placed.point).pose.inverse()
        covariance = UNKNOWN_COVARIANCE if placed.covariance is None else placed.covariance
        self._localizer.add_initial(T_map_keyframe, covariance)
        return self._changes(placed.point.stamp_ns)

    def take_over(self, stamp_ns: int, T_map_base: Pose2, covariance: Floats, floor: int) -> list[Event]:
        """Claim a pose on a floor at the newest keyframe, of (3, 3) `covariance`, that was claimed here until now."""
        self._localizer.take_over(T_map_base, covariance, floor)
        return self._changes(stamp_ns)

    def edit(self, closure: int, restored: bool) -> list[Event]:
        """Raise VetoError: the map stays as it is."""
        done = "restored" if restored else "vetoed"
        raise VetoError(f"closure {closure} cannot be {done} while the robot localises: edit the map (wayfi closures)")

    def add_keyframe(self, point: PathPoint, placed: PlacedScan | None) -> list[Event]:
        """Add a keyframe at `point`, with its scan if there is one, and compare it with the map."""
        with self._timer("scan_matching"):
            self._track.add(point, placed)
        self._elevators.drive(point.path_m)
        with self._timer("localization"):
            self._localizer.add_keyframe()
            self._heed_elevators()
        return [*self._changes(point.stamp_ns), self._followed(point.stamp_ns)]

    def look(self, point: PathPoint, placed: PlacedScan) -> list[Event]:
        """Compare a scan that was taken while the wheels stood; a keyframe if it shows that the robot moved."""
        with self._timer("scan_matching"):
            moved = self._track.look(point, placed)
        self.watch_for_elevators(point, placed)
        return self.add_keyframe(point, placed) if moved else self._changes(point.stamp_ns)

    def watch_for_elevators(self, point: PathPoint, placed: PlacedScan) -> None:
        """Take note of a scan that was taken while the wheels stood."""
        self._elevators.see(placed.points, point.path_m, self._localizer.claimed is not None)
        self._heed_elevators()

    def add_wifi(self, stamp_ns: int, scan: PlacedWifiScan) -> list[Event]:
        """Use a WiFi scan at `stamp_ns`, no earlier than its own."""
        with self._timer("wifi"):
            self._elevators.hear(scan.receiver, scan.point.path_m, scan.readings)
            self._heed_elevators()
            self._localizer.add_wifi(scan.receiver, scan.readings)
        return self._changes(stamp_ns)

    def go_on(self, stamp_ns: int) -> list[Event]:
        """Do a slice of the search, and of what hypotheses wait for."""
        with self._timer("localization"):
            self._localizer.go_on(stamp_ns)
        return self._changes(stamp_ns)

    def laser_offset_s(self, path: DrivenPath) -> float | None:  # noqa: ARG002 - as SLAM's
        """None: a laser's clock is learnt while a map is made."""
        return None

    def shift_scans(self, seconds: float, trajectories: Trajectories) -> list[Event]:  # noqa: ARG002 - as SLAM's
        """Nothing: no scan is kept for long."""
        return []

    def forget_scans(self, reason: str) -> list[Event]:  # noqa: ARG002 - as SLAM's
        """Forget the scans of the last keyframes."""
        self._track.forget_scans()
        return []

    def history(self, stamp_ns: int) -> list[Event]:
        """The grid of the robot's floor at `stamp_ns`; that of floor 0 where it is not known."""
        floor = self._localizer.floor or 0
        return [grid_event(stamp_ns, self._building.grid_of(floor), floor)]

    def made_map(self) -> BuildingMap | None:
        """None: the map is as it was."""
        return None

    def finish(self, trajectories: Trajectories) -> tuple[DriveEstimate, list[Event]]:
        """The poses that were claimed, and the map as it was."""
        online = trajectories.online()
        claimed = np.isfinite(online[:, 0])
        poses = online[claimed]
        stamps_ns = trajectories.stamps_ns()[claimed]
        return DriveEstimate(stamps_ns, poses, poses, self._building, floors_at(stamps_ns, self._floors)), []

    def _followed(self, stamp_ns: int) -> HypothesesFollowed:
        """The hypotheses at the newest keyframe, the claimed one first, then by their evidence."""
        track, claimed = self._track, self._localizer.claimed
        followed = [h for h in self._localizer.hypotheses if h.keyframe >= track.first]
        followed.sort(key=lambda h: (h is not claimed, -h.evidence))
        poses = [(h.T_map_base @ track.between(h.keyframe, track.newest)).array() for h in followed]
        evidence = np.array([h.evidence for h in followed])
        points = points_of(track.scan(track.newest))
        return HypothesesFollowed(stamp_ns, np.array(poses).reshape(-1, 3), evidence, claimed is not None, points)

    def _heed_elevators(self) -> None:
        """Nothing is claimed while it is not known which floor the robot is on."""
        doubtful, heeded = self._elevators.doubtful, self._localizer.in_elevator
        if doubtful and not heeded:
            self._track.leave()
            self._localizer.leave_floor()
        elif heeded and not doubtful:
            self._localizer.enter_floor()

    def _changed_floor(self, stamp_ns: int) -> list[Event]:
        """The floor, if it is another than was told last, and its grid, if it is known."""
        floor = self._localizer.floor
        if floor == self._floor:
            return []
        self._floor = floor
        if floor is None:
            return [FloorChanged(stamp_ns, None)]
        self._floors.append((stamp_ns, floor))
        return [FloorChanged(stamp_ns, floor), *(self.history(stamp_ns) if self._told else [])]

    def _changes(self, stamp_ns: int) -> list[Event]:
        first = [*self._changed_floor(stamp_ns), *([] if self._told else self.history(stamp_ns))]
        health, told = self._localizer.health, self._told
        if told is not None and told.state is health.state and told.failure_category is health.failure_category:
            return first
        self._told = health
        return [*first, StateChanged(stamp_ns, health.state, health.reason, health.failure_category)]
