"""SLAM that goes on with a known map: the robot is found in it first, then the graph is one."""

from dataclasses import replace

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, between_all, compose_all, covariance_in_b
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import Event, FloorChanged, StateChanged, Warned
from wayfi.frontends.intake.pose_intake import PlacedPose
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.continuing import MapFix
from wayfi.frontends.maps.pruning import pruned
from wayfi.frontends.maps.selecting import alone
from wayfi.frontends.modes.localization_core import FoundPose, LocalizationCore
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.live_pose import Anchor
from wayfi.frontends.odometry.trajectories import Trajectories
from wayfi.frontends.result import DriveEstimate
from wayfi.frontends.scan_points import PlacedScan
from wayfi.frontends.slam import SlamCore
from wayfi.frontends.slam_config import SlamConfig
from wayfi.frontends.timer import Timer
from wayfi.frontends.wifi.readings import PlacedWifiScan


class ContinuedSlam(SlamCore):
    """The drive is estimated from its beginning; no pose is claimed before it is found in the map `building`.

    Joining the two graphs is the work of several messages: meanwhile the pose is the one that was found, followed on.
    """

    def __init__(self, config: SlamConfig, prior: Calibration, timer: Timer, building: BuildingMap) -> None:
        super().__init__(config, prior, timer, building)
        self._finding: LocalizationCore | None = LocalizationCore(config, prior, timer, building)
        self._joining: MapFix | None = None  # what joins the map, while the graph is being rebuilt with it

    @property
    def floor(self) -> int | None:
        """The floor of the map on which the robot is."""
        return self._finding.floor if self._finding and self._joining else super().floor

    def anchor(self) -> Anchor | None:
        """The newest keyframe as the anchor of poses since then; None while the robot is not found."""
        if self._finding is None:
            return super().anchor()
        return self._finding.anchor() if self._joining else None

    def made_map(self) -> BuildingMap | None:
        """The map with what the drive has added so far; None while the robot is not found, or joins it."""
        return None if self._finding else super().made_map()

    def take_over(self, stamp_ns: int, T_map_base: Pose2, covariance: Floats, floor: int) -> list[Event]:
        """Join the map at a pose on a floor, of (3, 3) `covariance`, that was claimed in it for the newest keyframe."""
        if self._finding is None:
            return []
        return self._sought(stamp_ns, self._finding.take_over(stamp_ns, T_map_base, covariance, floor))

    def add_pose(self, placed: PlacedPose) -> list[Event]:
        """Add a pose from outside; an initial pose helps to find the robot."""
        if self._finding is None:
            return super().add_pose(placed)
        return self._sought(placed.point.stamp_ns, self._finding.add_pose(placed))

    def add_keyframe(self, point: PathPoint, placed: PlacedScan | None) -> list[Event]:
        """Add a keyframe at `point`, with its scan if there is one, and close loops from it."""
        events = super().add_keyframe(point, placed)
        if self._finding is None:
            return events
        return _without(StateChanged, events) + self._sought(point.stamp_ns, self._finding.add_keyframe(point, placed))

    def look(self, point: PathPoint, placed: PlacedScan) -> list[Event]:
        """Compare a scan that was taken while the wheels stood; a keyframe if it shows that the robot moved."""
        if self._finding is None:
            return super().look(point, placed)
        self._finding.watch_for_elevators(point, placed)
        before = self.keyframe_count
        events = super().look(point, placed)
        return events if self.keyframe_count > before else _without(StateChanged, events)

    def add_wifi(self, stamp_ns: int, scan: PlacedWifiScan) -> list[Event]:
        """Add a WiFi scan at `stamp_ns`, no earlier than its own."""
        events = super().add_wifi(stamp_ns, scan)
        if self._finding is None:
            return events
        return _without(FloorChanged, events) + self._sought(stamp_ns, self._finding.add_wifi(stamp_ns, scan))

    def go_on(self, stamp_ns: int) -> list[Event]:
        """Do a slice of the work that is not tied to a measurement."""
        events = super().go_on(stamp_ns)
        if self._finding is None:
            return events
        if self._joining:
            with self._timer("backend"):
                self._graph.update()
        return events + self._sought(stamp_ns, self._finding.go_on(stamp_ns))

    def edit(self, closure: int, restored: bool) -> list[Event]:
        """Take an accepted closure out of the graph, or put a vetoed one back. Raises VetoError."""
        events = super().edit(closure, restored)
        return events if self._finding is None else _without(StateChanged, events)

    def forget_scans(self, reason: str) -> list[Event]:
        """Remove all scans so far, and what they contributed; a robot that is not found is sought by later ones."""
        if self._finding:
            self._finding.forget_scans(reason)
        return super().forget_scans(reason)

    def _sought(self, stamp_ns: int, events: list[Event]) -> list[Event]:
        """Join the map once the robot is found; `events` are those of looking for it."""
        if self._joining is None and self._finding is not None:
            found = self._finding.found
            return [*events, self._begin_joining(self._fix(found))] if found else events
        return events if self._graph.restarts else [*events, *self._joined(stamp_ns)]

    def _begin_joining(self, fix: MapFix) -> Event:
        """Let the graph be rebuilt with the drive where it was found in the map."""
        self._joining, poses = fix, self.poses.copy()
        T = Pose2.of(poses[fix.a]) @ fix.T_a_b @ Pose2.of(poses[fix.b]).inverse()
        poses[self.keyframes.first :] = compose_all(T.array(), poses[self.keyframes.first :])
        judged = self._lidar_closer.enter_fix(fix)
        self._graph.restart(self._graph.calibrations(), poses)
        return judged

    def _joined(self, stamp_ns: int) -> list[Event]:
        """Go on in the map: the graph has been rebuilt."""
        assert self._joining is not None
        self.keyframes.join(self._joining.a)
        self._finding = self._joining = None
        return [*self._estimate.update(stamp_ns, moved=True), *self._observe(stamp_ns)]

    def finish(self, trajectories: Trajectories) -> tuple[DriveEstimate, list[Event]]:
        """Close the last loops, and leave out of the map what the drive has only repeated.

        If the robot was not found, the drive is a map of its own.
        """
        joined: list[Event] = []
        if self._joining:
            self._graph.settle()
            joined = self._joined(self.keyframes.newest.point.stamp_ns)
        result, last = super().finish(trajectories)
        events = joined + last
        if self._finding is None or not self.keyframe_count:
            kept = pruned(result.building, self._config.pruning, self._config.lidar.visibility, self._config.map)
            return replace(result, building=kept), events
        T = Pose2.of(result.building.poses[self.keyframes.first]).inverse()
        building = alone(result.building, self.keyframes.first, self._config.map)
        told = Warned(int(result.stamps_ns[-1]), "the robot was not found in the map: the drive is a map of its own")
        final = compose_all(T.array(), result.final)
        return replace(result, final=final, building=building, is_separate=True), [*events, told]

    def _fix(self, found: FoundPose) -> MapFix:
        """The pose that was found of a keyframe of the drive, in the nearest keyframe of the map on its floor."""
        first = self.keyframes.first
        apart = between_all(self.poses[:first], found.T_map_base.array())
        elsewhere = self.keyframes.floors[:first] != found.floor
        a = int(np.argmin(np.where(elsewhere, np.inf, np.hypot(apart[:, 0], apart[:, 1]))))
        T_a_b = Pose2.of(apart[a])
        in_a = covariance_in_b(found.covariance, float(self.poses[a, 2]))
        return MapFix(a, first + found.keyframe, T_a_b, in_a, np.nan, np.nan)


def _without(kind: type, events: list[Event]) -> list[Event]:
    """The events of a drive that is not placed in its map yet, but for those that only then are true."""
    return [event for event in events if not isinstance(event, kind)]
