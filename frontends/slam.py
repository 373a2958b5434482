"""Keyframes, fingerprints and closures into one graph: what is believed of the drive."""

import math
from contextlib import AbstractContextManager
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.factors import BetweenFactor, WheelFactor
from wayfi.backend.graph.health import Health, State, judge_health
from wayfi.backend.graph.pose_graph import PoseGraph, UpdateSummary
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.grid.grid_map import GridMap
from wayfi.backend.pose2 import Floats, Pose2, between_all
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.closures.lidar_closer import LidarCloser
from wayfi.frontends.closures.verdicts import Verdicts
from wayfi.frontends.closures.wifi_closer import WifiCloser
from wayfi.frontends.cloud.cloud_odometry import CloudOdometry
from wayfi.frontends.events import (
    CalibrationUpdated,
    Event,
    FingerprintAdded,
    GraphUpdated,
    KeyframeAdded,
    StateChanged,
    SubmapMatched,
)
from wayfi.frontends.intake.scan_intake import PlacedScan
from wayfi.frontends.keyframes import Keyframe, Keyframes
from wayfi.frontends.lidar.laser_clock import LaserClock
from wayfi.frontends.lidar.scan_tracker import KeyframeMatch, ScanTracker
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.live_pose import ORIGIN_COVARIANCE, Anchor
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.slam_config import SlamConfig
from wayfi.frontends.wifi.fingerprints import Readings, Similar
from wayfi.frontends.wifi.wifi import Fingerprint, WifiCandidate, WifiFrontend

CALIBRATION_EVERY = 20  # keyframes between two looks at the calibration's sigmas
SETTLING_REVIEWS = 3
NO_HITS: NDArray[np.float32] = np.empty((0, 2), np.float32)
RECENT_KEYFRAMES = 3  # that a new keyframe moves where no loop closes


class Timer(Protocol):
    """Times a stage; see service.timing."""

    def __call__(self, stage: str) -> AbstractContextManager[None]:
        """Time what runs inside."""
        ...


class Slam:
    """The state of the estimation. Poses of keyframes are `poses` (n, 3) in `map`, as last updated."""

    def __init__(self, config: SlamConfig, prior: Calibration, timer: Timer) -> None:
        self._config = config
        self._timer = timer
        self.graph = PoseGraph(config.backend, prior.wheels)
        self.keyframes = Keyframes()
        self.wifi = WifiFrontend(config.wifi, prior.receivers)
        self.grid = GridMap(config.map)
        self._start_tracking()
        verdicts = Verdicts()
        self._lidar_closer = LidarCloser(self.graph, self.keyframes, verdicts, config.closure, config.lidar, timer)
        self._wifi_closer = WifiCloser(
            self.graph, self.keyframes, verdicts, prior.wheels, config.closure.consensus, config.wifi, self.wifi.confirm
        )
        self._poses: Floats = np.zeros((64, 3))
        self._calibration: Floats = prior.wheels.values
        self._covariance: Floats = ORIGIN_COVARIANCE
        self.health: Health | None = None

    def __setstate__(self, state: dict[str, Any]) -> None:
        """The poses are those of the graph, which has started again."""
        vars(self).update(state)
        self._poses[: len(self.keyframes)] = self.graph.poses()[: len(self.keyframes)]

    @property
    def poses(self) -> Floats:
        """(n, 3) poses of all keyframes in `map`."""
        return self._poses[: len(self.keyframes)]

    def motion_to(self, point: PathPoint) -> WheelMotion:
        """What the wheels say of the way from the newest keyframe to `point`."""
        return self.keyframes[len(self.keyframes) - 1].point.motion_to(point)

    def keyframe_stretch(self) -> float:
        """Keyframes stand closer where the wheels are found to be poor: a factor on their distance."""
        return max(0.2, 1.0 / math.sqrt(self._tracker.covariance_scale))

    def anchor(self) -> Anchor:
        """What poses since the newest keyframe hang on."""
        keyframe = self.keyframes[len(self.keyframes) - 1]
        state = self.health.state if self.health else State.TRACKING
        T_map_base = Pose2.of(self.poses[-1])
        return Anchor(
            keyframe.point, T_map_base, self._covariance, self._calibration, self._tracker.covariance_scale, state
        )

    def add_keyframe(self, point: PathPoint, placed: PlacedScan | None) -> list[Event]:
        """A new keyframe at `point`, with its scan if there is one; closes loops from it."""
        events: list[Event] = []
        guess = self._guess(point) if len(self.keyframes) else Pose2()
        number = self.graph.add_keyframe(guess)
        tracked = self._connect(point, placed, number) if number else None
        self._remember(point, placed, guess)
        moved = self.graph.pending
        events.extend(self._update(point.stamp_ns))
        T_map_base = Pose2.of(self.poses[-1])
        ratio = tracked.match.inlier_ratio if tracked else np.nan
        points = _points(placed.points if placed else None)
        events.insert(0, KeyframeAdded(number, point.stamp_ns, T_map_base, points, ratio))
        if tracked:
            before = Pose2.of(self.poses[-2])
            submap = before.transform(tracked.submap)
            events.append(SubmapMatched(point.stamp_ns, number, submap, guess, T_map_base, ratio))
        with self._timer("closure"):
            if moved:
                events += self._review()
            events += self._lidar_closer.close_by_estimate(number, point.stamp_ns, self.poses)
        return events + self._observe(point.stamp_ns)

    def add_wifi(self, stamp_ns: int, receiver: str, point: PathPoint, readings: Readings) -> list[Event]:
        """A WiFi scan of `point`, at `stamp_ns` or seconds before; closes loops by the fingerprint it completes."""
        keyframe = self.keyframes.before(point.stamp_ns)
        T = self.keyframes[keyframe].point.motion_to(point).corrected(self._calibration)
        with self._timer("wifi"):
            fingerprint = self.wifi.add_scan(point.stamp_ns, receiver, keyframe, T, point, readings)
            if fingerprint is None:
                return []
            similar = self.wifi.similar(fingerprint)
            candidate = self.wifi.candidate(fingerprint, similar)
        events: list[Event] = [_fingerprint_event(fingerprint, similar)]
        with self._timer("closure"):
            if candidate is not None and self._lidar_closer.can_check(candidate):
                outcome = self._lidar_closer.close_by_wifi(candidate, stamp_ns, self.poses)
                if outcome.closed:
                    self.wifi.confirm(candidate)
                elif outcome.open:
                    self.wifi.hold(candidate)
                events += outcome.events
            elif candidate is not None:
                self.wifi.hold(candidate)
            events += self._close_by_wifi(self.wifi.released(), stamp_ns)
        return events

    def settle(self, stamp_ns: int) -> list[Event]:
        """At the end of a drive: take in the last closures, and review them `SETTLING_REVIEWS` times at most."""
        events = self._close_by_wifi(self.wifi.released(at_end=True), stamp_ns, last=True)
        for _ in range(SETTLING_REVIEWS):
            self.graph.settle()
            events += self._update(stamp_ns, moved=True)
            reviewed = self._review()
            if not reviewed:
                break
            events += reviewed
        self.graph.settle()
        return events + self._update(stamp_ns, moved=True)

    def _close_by_wifi(self, candidates: list[WifiCandidate], stamp_ns: int, last: bool = False) -> list[Event]:
        events = [e for candidate in candidates for e in self._wifi_closer.judge(candidate, stamp_ns, self.poses)]
        return events + self._wifi_closer.decide(stamp_ns, self.poses, last)

    def _review(self) -> list[Event]:
        return self._lidar_closer.review(self.poses) + self._wifi_closer.review(self.poses)

    def _start_tracking(self) -> None:
        self._tracker = ScanTracker(self.keyframes, self._config.lidar, self._config.odometry)
        self._clouds = CloudOdometry(self._config.lidar)
        self.laser_clock = LaserClock(self._config.lidar.clock)
        self._matches: list[int] = []

    def forget_scans(self, reason: str) -> list[Event]:
        """Take out of the graph and of the map what the laser has said so far."""
        for number in self._matches:
            self.graph.remove(number)
        self.keyframes.forget_scans()
        self._start_tracking()
        self.grid = GridMap(self._config.map)
        for _ in range(len(self.keyframes)):
            self.grid.add(NO_HITS)
        return self._lidar_closer.withdraw(reason)

    def history(self) -> list[Event]:
        """Every keyframe with its scan, where it is believed to be."""
        return [
            KeyframeAdded(k, self.keyframes[k].point.stamp_ns, Pose2.of(pose), _points(self.keyframes[k].scan), np.nan)
            for k, pose in enumerate(self.poses)
        ]

    def fingerprint_poses(self) -> Floats:
        """(m, 3) poses of all fingerprints in `map`."""
        return self.wifi.places(self.poses)

    def _guess(self, point: PathPoint) -> Pose2:
        return Pose2.of(self.poses[-1]) @ self.motion_to(point).corrected(self._calibration)

    def _connect(self, point: PathPoint, placed: PlacedScan | None, number: int) -> KeyframeMatch | None:
        """Factors from the newest keyframe to the one about to be added: the wheels', and the laser's if it sees."""
        motion = self.motion_to(point)
        tracked = None
        if placed is not None:
            with self._timer("scan_matching"):
                tracked = self._track(placed, motion, number)
            if tracked and tracked.match.inlier_ratio >= self._config.lidar.min_inlier_ratio:
                match = tracked.match
                self._matches.append(
                    self.graph.add(BetweenFactor(number - 1, number, match.T_submap_scan, match.covariance))
                )
                before = self.keyframes[number - 1]
                if before.scan is not None:
                    self.laser_clock.add_turn(before.point.stamp_ns, point.stamp_ns, match.T_submap_scan.theta)
        self.graph.add(WheelFactor(number - 1, number, motion, self._tracker.wheel_covariance(motion)))
        return tracked

    def _track(self, placed: PlacedScan, motion: WheelMotion, number: int) -> KeyframeMatch | None:
        """The match of a keyframe's cloud by KISS-ICP where there is one that it can place, else that of its scan."""
        guess = motion.corrected(self._calibration)
        tracked = None
        if placed.band is not None:
            tracked = self._clouds.match(placed.band, number, guess, self._tracker.wheel_covariance(motion))
        if tracked and tracked.match.inlier_ratio >= self._config.lidar.min_inlier_ratio:
            self._tracker.update_scale(motion, guess, tracked.match)
            return tracked
        return self._tracker.match(placed.points, motion, guess, self.poses)

    def _remember(self, point: PathPoint, placed: PlacedScan | None, guess: Pose2) -> None:
        self.keyframes.append(Keyframe(point, placed.points if placed else None))
        if len(self.keyframes) > len(self._poses):
            self._poses = np.resize(self._poses, (2 * len(self._poses), 3))
        self._poses[len(self.keyframes) - 1] = guess.array()
        hits = placed.hits if placed else NO_HITS
        sensor = placed.points.T_base_laser if placed else Pose2()
        self.grid.add(hits, (sensor.x, sensor.y))

    def _update(self, stamp_ns: int, moved: bool = False) -> list[Event]:
        """Update the graph; `moved` says that earlier poses have moved already."""
        moved = moved or self.graph.pending
        with self._timer("backend"):
            summary: UpdateSummary = self.graph.update()
            if moved:
                self._poses[: len(self.keyframes)] = self.graph.poses()
            else:
                self._refresh_recent()
            self._calibration = self.graph.calibration_values()
        number = len(self.keyframes) - 1
        poses = self.poses.copy() if moved else None
        residual = self._step_residual(number)
        return [GraphUpdated(stamp_ns, number, poses, summary.added, summary.removed, summary.factors, residual)]

    def _refresh_recent(self) -> None:
        n = len(self.keyframes)
        for k in range(max(0, n - RECENT_KEYFRAMES), n):
            self._poses[k] = self.graph.pose(k).array()

    def _step_residual(self, number: int) -> float:
        """How far (m) the estimate of the newest step is from what the calibrated wheels say."""
        if number == 0:
            return 0.0
        motion = self.keyframes[number - 1].point.motion_to(self.keyframes[number].point)
        step = between_all(self.poses[-2], self.poses[-1])[0]
        expected = motion.corrected(self._calibration)
        return float(np.hypot(step[0] - expected.x, step[1] - expected.y))

    def _observe(self, stamp_ns: int) -> list[Event]:
        """What the newest keyframe says of health and calibration."""
        events: list[Event] = []
        number = len(self.keyframes) - 1
        with self._timer("backend"):
            self._covariance = self.graph.covariance(number)
            if number % CALIBRATION_EVERY == 0:
                calibration = self.graph.calibration()
                events.append(CalibrationUpdated(stamp_ns, calibration.values, calibration.sigmas))
        backend = self._config.backend
        health = judge_health(self._covariance, backend.uncertain_sigma_m, backend.lost_sigma_m)
        if self.health is None or health.state is not self.health.state:
            events.append(StateChanged(stamp_ns, health.state, health.reason))
        self.health = health
        return events


def _points(scan: ScanPoints | None) -> NDArray[np.float32]:
    return NO_HITS if scan is None else scan.points.astype(np.float32)


def _fingerprint_event(f: Fingerprint, similar: Similar) -> FingerprintAdded:
    return FingerprintAdded(
        f.number, f.stamp_ns, f.receiver, f.keyframe, f.T_keyframe_base, f.readings.bssids, f.readings.rssi,
        similar.numbers, similar.similarity,
    )  # fmt: skip
