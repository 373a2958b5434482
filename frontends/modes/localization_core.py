"""Localisation in a known map, where the pipeline has SLAM else: nothing is added to the map, and no graph grows."""

import numpy as np

from wayfi.backend.graph.health import Health, State
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.closures.vetoes import VetoError
from wayfi.frontends.event_making import grid_event, points_of
from wayfi.frontends.events import Event, HypothesesFollowed, StateChanged
from wayfi.frontends.intake.pose_intake import PlacedPose
from wayfi.frontends.localization.local_track import LocalTrack
from wayfi.frontends.localization.localizer import Localizer
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.odometry.live_pose import Anchor
from wayfi.frontends.odometry.trajectories import Trajectories
from wayfi.frontends.result import DriveEstimate
from wayfi.frontends.scan_points import PlacedScan
from wayfi.frontends.slam_config import SlamConfig
from wayfi.frontends.step_matcher import StepMatcher
from wayfi.frontends.timer import Timer
from wayfi.frontends.wifi.readings import PlacedWifiScan

UNKNOWN_COVARIANCE = np.diag([0.25, 0.25, 0.0685])  # of a pose from outside: what RViz says of a click, m^2 and rad^2


class LocalizationCore:
    """The state of localisation in the map `building`; its memory is bounded however long it goes on."""

    def __init__(self, config: SlamConfig, prior: Calibration, timer: Timer, building: BuildingMap) -> None:
        self._building, self._timer = building, timer
        self._track = LocalTrack(config.lidar, config.odometry, prior.wheels.values)
        self._localizer = Localizer(building, self._track, config.lidar, config.localization)
        self._told: Health | None = None

    @property
    def steps(self) -> StepMatcher:
        """What matches the scans of one step."""
        return self._track.steps

    @property
    def found(self) -> tuple[int, Pose2, Floats] | None:
        """A keyframe, its pose in `map` and its (3, 3) covariance there, if they are known without a doubt."""
        return self._localizer.pose() if self._localizer.health.state is State.TRACKING else None

    @property
    def keyframe_count(self) -> int:
        """How many keyframes there have been."""
        return len(self._track)

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

    def take_over(self, stamp_ns: int, T_map_base: Pose2, covariance: Floats) -> list[Event]:
        """Claim a pose at the newest keyframe, of (3, 3) `covariance`, that was claimed in this map until now."""
        self._localizer.take_over(T_map_base, covariance)
        return self._changes(stamp_ns)

    def edit(self, closure: int, restored: bool) -> list[Event]:
        """Raise VetoError: the map stays as it is."""
        done = "restored" if restored else "vetoed"
        raise VetoError(f"closure {closure} cannot be {done} while the robot localises: edit the map (wayfi closures)")

    def add_keyframe(self, point: PathPoint, placed: PlacedScan | None) -> list[Event]:
        """Add a keyframe at `point`, with its scan if there is one, and compare it with the map."""
        with self._timer("scan_matching"):
            self._track.add(point, placed)
        with self._timer("localization"):
            self._localizer.add_keyframe()
        return [*self._changes(point.stamp_ns), self._followed(point.stamp_ns)]

    def look(self, point: PathPoint, placed: PlacedScan) -> list[Event]:
        """Compare a scan that was taken while the wheels stood; a keyframe if it shows that the robot moved."""
        with self._timer("scan_matching"):
            moved = self._track.look(point, placed)
        return self.add_keyframe(point, placed) if moved else []

    def add_wifi(self, stamp_ns: int, scan: PlacedWifiScan) -> list[Event]:
        """Use a WiFi scan at `stamp_ns`, no earlier than its own."""
        with self._timer("wifi"):
            self._localizer.add_wifi(scan.receiver, scan.readings)
        return self._changes(stamp_ns)

    def go_on(self, stamp_ns: int) -> list[Event]:
        """Do a slice of the search, and of what hypotheses wait for."""
        with self._timer("localization"):
            self._localizer.go_on()
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
        """The map's grid at `stamp_ns`."""
        return [grid_event(stamp_ns, self._building.grid)]

    def made_map(self) -> BuildingMap | None:
        """None: the map is as it was."""
        return None

    def finish(self, trajectories: Trajectories) -> tuple[DriveEstimate, list[Event]]:
        """The poses that were claimed, and the map as it was."""
        online = trajectories.online()
        claimed = np.isfinite(online[:, 0])
        poses = online[claimed]
        return DriveEstimate(trajectories.stamps_ns()[claimed], poses, poses, self._building), []

    def _followed(self, stamp_ns: int) -> HypothesesFollowed:
        """The hypotheses at the newest keyframe, the claimed one first, then by their evidence."""
        track, claimed = self._track, self._localizer.claimed
        followed = [h for h in self._localizer.hypotheses if h.keyframe >= track.first]
        followed.sort(key=lambda h: (h is not claimed, -h.evidence))
        poses = [(h.T_map_base @ track.between(h.keyframe, track.newest)).array() for h in followed]
        evidence = np.array([h.evidence for h in followed])
        points = points_of(track.scan(track.newest))
        return HypothesesFollowed(stamp_ns, np.array(poses).reshape(-1, 3), evidence, claimed is not None, points)

    def _changes(self, stamp_ns: int) -> list[Event]:
        health, told = self._localizer.health, self._told
        if told is not None and told.state is health.state and told.failure_category is health.failure_category:
            return []
        first = [] if told else self.history(stamp_ns)
        self._told = health
        return [*first, StateChanged(stamp_ns, health.state, health.reason, health.failure_category)]
