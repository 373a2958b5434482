"""Keyframes, fingerprints and closures become one graph, and the graph one estimate of the drive."""

from itertools import pairwise

from wayfi.backend.graph.factors import BetweenFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.grid.floor_grids import FloorGrids
from wayfi.backend.pose2 import Floats, Pose2, diagonal_covariance
from wayfi.frontends.axes.axis_headings import AxisHeadings
from wayfi.frontends.axes.wall_headings import WallHeadings
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.closures.fix_closer import FixCloser, OutsideFix
from wayfi.frontends.closures.heard_ahead import learn_heard_ahead
from wayfi.frontends.closures.lidar_closer import LidarCloser
from wayfi.frontends.closures.verdicts import Verdicts
from wayfi.frontends.closures.vetoes import Vetoes
from wayfi.frontends.closures.wifi_closer import WifiCloser
from wayfi.frontends.event_making import NO_HITS, fingerprint_event, grid_event, keyframe_events
from wayfi.frontends.events import Dropped, DropReason, Event
from wayfi.frontends.floors.floor_tracker import FloorTracker
from wayfi.frontends.graph_estimate import GraphEstimate
from wayfi.frontends.intake.pose_intake import PlacedPose
from wayfi.frontends.keyframes import Keyframe, Keyframes
from wayfi.frontends.lidar.doubt import Finding
from wayfi.frontends.lidar.laser_clock import LaserClock
from wayfi.frontends.lidar.scan_tracker import KeyframeMatch
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.measurements import SECOND_NS, Sensor
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.odometry.live_pose import Anchor
from wayfi.frontends.odometry.trajectories import Trajectories
from wayfi.frontends.odometry.wheel_spins import WheelSpins, doubt_spun, wheel_step
from wayfi.frontends.result import DriveEstimate
from wayfi.frontends.scan_points import PlacedScan
from wayfi.frontends.slam_config import SlamConfig
from wayfi.frontends.slam_map import DriveParts, begin_with, drive_estimate, history_of, in_frame_of, map_of
from wayfi.frontends.step_matcher import StepMatcher
from wayfi.frontends.timer import Timer
from wayfi.frontends.wifi.fingerprints import WifiCandidate
from wayfi.frontends.wifi.readings import PlacedWifiScan
from wayfi.frontends.wifi.wifi_frontend import WifiFrontend

ANYWHERE = diagonal_covariance(1e3, 10.0)  # of the way from a map to the beginning of a drive, which is unknown


class SlamCore:
    """The state of the estimation: the graph, the frontends that add factors to it, and the grid drawn from it."""

    def __init__(
        self, config: SlamConfig, prior: Calibration, timer: Timer, building: BuildingMap | None = None
    ) -> None:
        self._config, self._timer = config, timer
        self._graph = PoseGraph(config.backend, prior.wheels, Pose2.of(building.poses[0]) if building else Pose2())
        self.keyframes = Keyframes()
        self._estimate = GraphEstimate(self._graph, self.keyframes, prior.wheels.values, config.backend, timer)
        self._wifi = WifiFrontend(config.wifi, prior.receivers)
        self._floors = FloorTracker(self.keyframes, self._wifi, config.floors, config.wifi.similarity_sigma_db)
        self._grids = FloorGrids(config.map)
        self._start_tracking()
        self._verdicts = verdicts = Verdicts()
        self._lidar_closer = LidarCloser(self._graph, self.keyframes, verdicts, config.closure, config.lidar, timer)
        self._wifi_closer = WifiCloser(
            self._graph, self.keyframes, verdicts, prior.wheels, config.closure.consensus, config.wifi,
            self._wifi.confirm, self._lidar_closer.walls,
        )  # fmt: skip
        self._fix_closer = FixCloser(self._graph, self.keyframes, verdicts, config.closure)
        closers = self._lidar_closer, self._wifi_closer.claims, self._fix_closer
        self._parts = DriveParts(
            self._graph, self.keyframes, self._wifi, self._grids, verdicts, self._lidar_closer, closers,
            Vetoes(self._graph, verdicts, closers),
        )  # fmt: skip
        self._before = begin_with(building, self._parts, config.closure.min_path_m) if building else None
        self._axes = AxisHeadings(self._graph, prior.wheels, config.odometry.axes)
        self._estimate.reread()

    @property
    def keyframe_count(self) -> int:
        """How many keyframes of its own the drive has had."""
        return len(self.keyframes) - self.keyframes.first

    @property
    def poses(self) -> Floats:
        """(n, 3) poses of all keyframes in `map`, as last updated."""
        return self._estimate.poses

    @property
    def floor(self) -> int | None:
        """The floor of the map on which the robot is."""
        return self.keyframes.floor

    def motion_to(self, point: PathPoint) -> WheelMotion:
        """The wheels' motion from the newest keyframe to `point`."""
        return self.keyframes.newest.point.motion_to(point)

    def anchor(self) -> Anchor | None:
        """The newest keyframe as the anchor of poses since then; None while the pose is not claimed."""
        estimate, point, scale = self._estimate, self.keyframes.newest.point, self.steps.covariance_scale
        return Anchor(point, Pose2.of(self.poses[-1]), estimate.covariance, estimate.calibration, scale, estimate.state)

    def look(self, point: PathPoint, placed: PlacedScan) -> list[Event]:
        """Compare a scan that was taken while the wheels stood; a keyframe if it shows that the robot moved."""
        with self._timer("scan_matching"):
            self._floors.look(placed.points)
            moved = self.steps.look(placed, self.motion_to(point), self._step(point), self.poses)
        return self.add_keyframe(point, placed) if moved else self._estimate.judge(point.stamp_ns, self.steps.doubt)

    def add_keyframe(self, point: PathPoint, placed: PlacedScan | None) -> list[Event]:
        """Add a keyframe at `point`, with its scan if there is one, and close loops from it."""
        number = len(self.keyframes)
        tracked = self._track(point, placed, number)
        guess = Pose2()
        if self.keyframe_count:
            guess = Pose2.of(self.poses[-1]) @ self.steps.first_guess(self._step(point), tracked)
        self._graph.add_keyframe(guess)
        if self.keyframe_count:
            self._connect(point, tracked, number)
        elif number:
            self._graph.add(BetweenFactor(number - 1, number, Pose2.of(self.poses[-1]).between(guess), ANYWHERE))
        self._append(point, placed, guess)
        self._walls.follow(self.poses, self._estimate.covariance[2, 2], self._lidar_closer.variance_factor.value)
        updated = self._estimate.update(point.stamp_ns)
        added, *matched = keyframe_events(number, self.keyframes[number], tracked, self.poses)
        events = [added, *updated, *matched]
        with self._timer("closure"):
            events += self._review() if self._estimate.moved else self._wifi_closer.go_on(self.poses)
            if self._floors.known_at(point.path_m):
                events += self._lidar_closer.close_by_estimate(number, point.stamp_ns, self.poses)
                events += self._lidar_closer.close_by_search(number, point.stamp_ns, self.poses)
            events += self._fix_closer.judge(self.poses)
        return events + self._observe(point.stamp_ns)

    def add_wifi(self, stamp_ns: int, scan: PlacedWifiScan) -> list[Event]:
        """Add a WiFi scan at `stamp_ns`, no earlier than its own; close loops by the fingerprint that it completes."""
        keyframe = self.keyframes.before(scan.point.stamp_ns)
        T = self.keyframes[keyframe].point.motion_to(scan.point).corrected(self._estimate.calibration)
        with self._timer("wifi"):
            events = self._floors.hear(scan, stamp_ns, self.poses)
            events += self._redrawn(stamp_ns) if events else []
            fingerprint = self._wifi.add_scan(scan, keyframe, T)
            if fingerprint is None:
                return events
            similar = self._wifi.similar(fingerprint)
            candidate = self._wifi.candidate(fingerprint, similar)
        events.append(fingerprint_event(fingerprint, similar))
        with self._timer("closure"):
            if candidate is not None and self._floors.may_close(candidate):
                events += self._check(candidate, stamp_ns)
            events += self._close_by_wifi(self._wifi.released(), stamp_ns)
        return events

    def add_pose(self, placed: PlacedPose) -> list[Event]:
        """Add a pose from outside: a fix closes a loop, an initial pose needs a map, in which it is."""
        stamp_ns = placed.point.stamp_ns
        if placed.sensor is Sensor.INITIAL_POSE:
            return [Dropped(placed.sensor, stamp_ns, DropReason.NO_MAP)]
        keyframe = self.keyframes.before(stamp_ns)
        T = self.keyframes[keyframe].point.motion_to(placed.point).corrected(self._estimate.calibration)
        return self._fix_closer.add(stamp_ns, keyframe, OutsideFix(placed.T_map_base, placed.covariance, T), self.poses)

    def edit(self, closure: int, restored: bool) -> list[Event]:
        """Take an accepted closure out of the graph, or put a vetoed one back. Raises VetoError."""
        judged = self._parts.vetoes.restore(closure) if restored else self._parts.vetoes.veto(closure)
        stamp_ns = self.keyframes.newest.point.stamp_ns
        return [judged, *self._estimate.solve_anew(stamp_ns), *self._observe(stamp_ns)]

    def go_on(self, stamp_ns: int) -> list[Event]:
        """Redraw the grid if enough has come since the last time."""
        return self._redrawn(stamp_ns) if self._grids.due else []

    def laser_offset_s(self, path: DrivenPath) -> float | None:
        """What is to be added to the laser's stamps, s; None while they are not known to differ from the odometry's."""
        return self._laser_clock.offset_s(path)

    def shift_scans(self, seconds: float, trajectories: Trajectories) -> list[Event]:
        """Move the keyframes with scans to where those were taken, `seconds` later; matches relate scans, and stay."""
        moved = self.keyframes.shift(round(seconds * SECOND_NS), trajectories)
        self._graph.replace_motions([a.motion_to(b) for a, b in pairwise(k.point for k in self.keyframes.own)])
        self._laser_clock = LaserClock(self._config.lidar.clock)
        return self._verdicts.move_stamps(moved)

    def forget_scans(self, reason: str) -> list[Event]:
        """Remove all scans so far, and what they contributed, from the graph and the grid."""
        for number in [*self._matches, *self._walls.sigmas_rad]:
            self._graph.remove(number)
        self.keyframes.forget_scans()
        self._start_tracking()
        self._grids.forget(self.keyframes.first)
        self._wifi_closer.withdraw_walls()
        return self._lidar_closer.withdraw(reason)

    def history(self, stamp_ns: int) -> list[Event]:
        """Every keyframe with its scan at its present pose, and the grid at `stamp_ns`."""
        return history_of(self._parts, self.poses, stamp_ns) if self.keyframe_count else []

    def made_map(self) -> BuildingMap | None:
        """The map that the drive has made so far, its grid as drawn last; None before the first keyframe."""
        return map_of(self._parts, self.poses, self._grids.drawn(), self._before) if self.keyframe_count else None

    def finish(self, trajectories: Trajectories) -> tuple[DriveEstimate, list[Event]]:
        """Close the last loops and draw the grid; returns the drive as estimated with everything."""
        events = self._settle(self.keyframes.newest.point.stamp_ns) if self.keyframe_count else []
        poses = in_frame_of(self.poses, None if self._fix_closer.factors() else self._before)
        with self._timer("map"):
            building = map_of(self._parts, poses, self._grids.settle(poses, self.keyframes.floors), self._before)
        estimate, floor = drive_estimate(trajectories, self.keyframes, building), self.keyframes.floor
        stamp_ns = int(estimate.stamps_ns[-1]) if len(estimate.stamps_ns) else 0
        return estimate, [*events, grid_event(stamp_ns, building.grid_of(floor), floor)]

    def _redrawn(self, stamp_ns: int) -> list[Event]:
        with self._timer("map"):
            return [grid_event(stamp_ns, self._grids.redraw(self.poses, self.keyframes.floors), self.keyframes.floor)]

    def _settle(self, stamp_ns: int) -> list[Event]:
        """Use the last WiFi candidates, and what only the whole drive tells; review all closures after each."""
        events = self._close_by_wifi(self._wifi.released(at_end=True), stamp_ns, last=True)
        self._walls.weigh_again(self._lidar_closer.variance_factor.value)
        events += self._settle_reviewed(stamp_ns)
        claims = self._wifi_closer.claims
        for learn in (self._axes.decide_again, self._axes.join_wings, lambda: learn_heard_ahead(self._graph, claims)):
            events += self._settle_reviewed(stamp_ns) if learn() else []
        return events

    def _settle_reviewed(self, stamp_ns: int) -> list[Event]:
        return self._estimate.settle(stamp_ns, lambda: self._review(last=True))

    def _check(self, candidate: WifiCandidate, stamp_ns: int) -> list[Event]:
        """Check a candidate by the laser if that saw both places; without a verdict, hold it for WiFi's own."""
        if not self._lidar_closer.can_check(candidate):
            self._wifi.hold(candidate)
            return []
        outcome = self._lidar_closer.close_by_wifi(candidate, stamp_ns, self.poses)
        if outcome.closed:
            self._wifi.confirm(candidate)
        elif outcome.open:
            self._wifi.hold(candidate)
        return outcome.events

    def _close_by_wifi(self, candidates: list[WifiCandidate], stamp_ns: int, last: bool = False) -> list[Event]:
        events = [e for candidate in candidates for e in self._wifi_closer.judge(candidate, stamp_ns, self.poses)]
        return events + self._wifi_closer.decide(stamp_ns, self.poses, last)

    def _review(self, last: bool = False) -> list[Event]:
        by_laser = self._lidar_closer.review(self.poses)
        return by_laser + self._wifi_closer.review(self.poses, last) + self._fix_closer.review(self.poses)

    def _observe(self, stamp_ns: int) -> list[Event]:
        return self._estimate.observe(stamp_ns, self._lidar_closer.variance_factor.value, self.steps.doubt)

    def _start_tracking(self) -> None:
        self.steps = StepMatcher(self.keyframes, self._config.lidar, self._config.odometry)
        self._laser_clock, self._spins = LaserClock(self._config.lidar.clock), WheelSpins(self._config.odometry)
        self._matches: list[int] = []
        self._walls = WallHeadings(self._graph, self.keyframes, self._config.lidar.walls)

    def _step(self, point: PathPoint) -> Pose2:
        """The step from the newest keyframe by the calibrated wheels."""
        return self.motion_to(point).corrected(self._estimate.calibration)

    def _track(self, point: PathPoint, placed: PlacedScan | None, number: int) -> KeyframeMatch | None:
        if placed is None or self.keyframes.begins_piece(number):
            return None
        with self._timer("scan_matching"):
            tracked = self.steps.match(placed, self.motion_to(point), self._step(point), number, self.poses)
        if tracked and tracked.judged.finding is Finding.MISFIT and self._floors.doubtful:
            self.keyframes.begin_piece(0.0)  # behind a cabin's door may be another floor
            return None
        return tracked

    def _connect(self, point: PathPoint, tracked: KeyframeMatch | None, number: int) -> None:
        """Add the factors from the newest keyframe to number `number`: the wheels', and the laser's if it matches."""
        motion = self.motion_to(point)
        covariance = self.steps.wheel_covariance(motion, tracked)
        matched, match = tracked is not None and self.steps.accepts(tracked), None
        wheels = WheelFactor(number - 1, number, motion, covariance, alone=not (matched or self._matches))
        added = self._graph.add(wheels)
        if tracked and tracked.judged.finding is Finding.MISFIT:
            self.keyframes.begin_piece(self._config.closure.min_path_m)
            self._lidar_closer.search_from(number)
        if tracked and matched:
            self._axes.interrupt()
            match = self._add_match(tracked, point, number)
        else:
            self._axes.follow(number, motion, covariance[2, 2], self.poses)
        step = wheel_step(added, wheels, self._step(point), match, self.steps.covariance_scale)
        doubt_spun(self._graph, self._spins.add(step))

    def _add_match(self, tracked: KeyframeMatch, point: PathPoint, number: int) -> BetweenFactor:
        match, before = tracked.match, self.keyframes[number - 1]
        factor = BetweenFactor(number - 1, number, match.T_submap_scan, match.covariance)
        self._matches.append(self._graph.add(factor))
        if before.scan is not None:
            self._laser_clock.add_turn(before.point.stamp_ns, point.stamp_ns, match.T_submap_scan.theta)
        return factor

    def _append(self, point: PathPoint, placed: PlacedScan | None, guess: Pose2) -> None:
        self.keyframes.append(Keyframe(point, placed.points if placed else None))
        self._estimate.append(guess)
        sensor = placed.points.T_base_laser if placed else Pose2()
        self._grids.add(self.keyframes.floor, placed.hits if placed else NO_HITS, (sensor.x, sensor.y))
