"""The last keyframes of a drive, placed by wheels and laser in a frame of their own: good for some metres."""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2, adjoint
from wayfi.frontends.keyframes import Keyframe, Keyframes
from wayfi.frontends.lidar.doubt import Finding
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.scan_tracker import KeyframeMatch
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.scan_points import PlacedScan, ScanPoints
from wayfi.frontends.step_matcher import StepMatcher

KEPT = 40  # keyframes: the local submap, and those that a place which is found late is tried on


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """The motion from one keyframe to the next with its (3, 3) covariance in the axes of the first.

    `moved`: the laser finds that the robot was moved meanwhile, and nothing tells how.
    """

    pose: Pose2
    covariance: Floats
    moved: bool = False


class LocalTrack:
    """Keyframes by their numbers, of which the last ones are kept."""

    def __init__(self, lidar: LidarConfig, odometry: OdometryConfig, calibration: Floats) -> None:
        self._calibration = calibration
        self._lidar, self._odometry = lidar, odometry
        self._keyframes = Keyframes()
        self._poses = np.zeros((0, 3))
        self._steps: list[Step] = []
        self._dropped = 0
        self.steps = StepMatcher(self._keyframes, lidar, odometry)

    def __len__(self) -> int:
        return self._dropped + len(self._keyframes)

    @property
    def oldest(self) -> int:
        """The number of the oldest keyframe that is kept."""
        return self._dropped

    @property
    def first(self) -> int:
        """The number of the oldest keyframe that is kept, and whose way to the newest is known."""
        return self._dropped + (self._keyframes.piece(len(self._keyframes) - 1)[0] if len(self._keyframes) else 0)

    @property
    def newest(self) -> int:
        """The number of the newest keyframe; -1 before the first."""
        return len(self) - 1

    @property
    def calibration(self) -> Floats:
        """(4,) calibration of the wheels."""
        return self._calibration

    def point(self, number: int) -> PathPoint:
        """Where a keyframe is on the driven path."""
        return self._keyframes[number - self._dropped].point

    def scan(self, number: int) -> ScanPoints | None:
        """The scan of a keyframe, if it has one."""
        return self._keyframes[number - self._dropped].scan

    def motion_to(self, point: PathPoint) -> WheelMotion:
        """The wheels' motion from the newest keyframe."""
        return self._keyframes.newest.point.motion_to(point)

    def between(self, a: int, b: int) -> Pose2:
        """T_a_b of two keyframes that are kept; the oldest stands for those before."""
        a = max(a, self._dropped)
        poses = self._poses
        return Pose2.of(poses[a - self._dropped]).between(Pose2.of(poses[b - self._dropped]))

    def back(self, reach_m: float) -> int:
        """The oldest keyframe within `reach_m` of path of the newest, and whose way to it is known."""
        path_m, number = self.point(self.newest).path_m, self.newest
        while number > self.first and path_m - self.point(number - 1).path_m <= reach_m:
            number -= 1
        return number

    def last_scans(self, most: int, apart_m: float, reach_m: float) -> tuple[list[ScanPoints], Floats]:
        """Up to `most` scans, `apart_m` of path apart, and their (n, 3) poses in the newest keyframe's base_link."""
        scans: list[ScanPoints] = []
        poses, at_m = [], np.inf
        for number in range(self.newest, self.back(reach_m) - 1, -1):
            scan, path_m = self.scan(number), self.point(number).path_m
            if scan is not None and at_m - path_m >= apart_m and len(scans) < most:
                scans.append(scan)
                poses.append(self.between(self.newest, number).array())
                at_m = path_m
        return scans, np.array(poses).reshape(-1, 3)

    def step_to(self, number: int) -> Step:
        """The step from the keyframe before to keyframe `number`."""
        return self._steps[number - self._dropped]

    def add(self, point: PathPoint, placed: PlacedScan | None) -> Step:
        """Add a keyframe; returns the step to it."""
        step = self._step(point, placed) if len(self) else Step(Pose2(), np.zeros((3, 3)))
        if step.moved:
            self._keyframes.begin_piece(0.0)
        before = Pose2.of(self._poses[-1]) if len(self._poses) else Pose2()
        self._poses = np.vstack([self._poses, (before @ step.pose).array()])
        self._steps.append(step)
        self._keyframes.append(Keyframe(point, placed.points if placed else None))
        self._drop()
        return step

    def leave(self) -> None:
        """The robot may see other walls from the next keyframe on: its scan is compared with none of before."""
        self._keyframes.begin_piece(0.0)

    def look(self, point: PathPoint, placed: PlacedScan) -> bool:
        """Compare a scan that was taken while the wheels stood; returns whether the robot moved all the same."""
        motion = self.motion_to(point)
        return self.steps.look(placed, motion, motion.corrected(self._calibration), self._poses)

    def forget_scans(self) -> None:
        """Forget all scans."""
        self._keyframes.forget_scans()
        self.steps = StepMatcher(self._keyframes, self._lidar, self._odometry)

    def _step(self, point: PathPoint, placed: PlacedScan | None) -> Step:
        motion = self.motion_to(point)
        guess = motion.corrected(self._calibration)
        begins_piece = self._keyframes.begins_piece(len(self._keyframes))
        compared = placed if not begins_piece else None
        tracked = self.steps.match(compared, motion, guess, len(self), self._poses) if compared else None
        covariance = self.steps.wheel_covariance(motion, tracked)
        moved = tracked is not None and tracked.judged.finding is Finding.MISFIT
        if tracked is None or not self.steps.accepts(tracked):
            return Step(guess, covariance, moved)
        return _fused(self.steps.first_guess(guess, tracked), covariance, tracked, moved)

    def _drop(self) -> None:
        if len(self._keyframes) >= 2 * KEPT:
            self._keyframes.forget_oldest(KEPT)
            self._poses, self._steps = self._poses[KEPT:], self._steps[KEPT:]
            self._dropped += KEPT


def _fused(guess: Pose2, covariance: Floats, tracked: KeyframeMatch, moved: bool) -> Step:
    """The wheels' step, of (3, 3) covariance, and the laser's as one."""
    match = tracked.match
    gain = covariance @ np.linalg.inv(covariance + match.covariance)
    apart = guess.between(match.T_submap_scan).theta
    e = np.array([match.T_submap_scan.x - guess.x, match.T_submap_scan.y - guess.y, apart])
    fused = covariance - gain @ covariance
    return Step(Pose2.of(guess.array() + gain @ e), 0.5 * (fused + fused.T), moved)


def moved_covariance(covariance: Floats, T_map_base: Pose2, step: Pose2, step_covariance: Floats) -> Floats:
    """(3, 3) covariance in `map` after a `step` from T_map_base, each with its own, the step's in base_link."""
    turn = Pose2(0.0, 0.0, T_map_base.theta)
    d = turn @ step
    lever = np.array([[1.0, 0.0, -d.y], [0.0, 1.0, d.x], [0.0, 0.0, 1.0]])
    rotation = adjoint(turn)
    return np.asarray(lever @ covariance @ lever.T + rotation @ step_covariance @ rotation.T)
