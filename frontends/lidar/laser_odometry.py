"""Odometry from the laser alone, for a robot without wheel odometry: KISS-ICP in the plane.

Vizzo et al., "KISS-ICP: In Defense of Point-to-Point ICP" (RA-L 2023); the points lie at z = 0.
"""

import math

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.voxel_map import VoxelMap

# KISS-ICP's own numbers (config.py: RegistrationConfig, AdaptiveThresholdConfig)
ITERATIONS, SETTLED = 500, 1e-4
FIRST_ERROR_M, LEAST_ERROR_M = 2.0, 0.1


class LaserOdometry:
    """Matches scans in their order, at constant velocity; the frame of its poses drifts."""

    def __init__(self, config: LidarConfig) -> None:
        self._max_range_m = config.max_range_m
        self._map = VoxelMap(config.lead_voxel_m, config.max_range_m, ITERATIONS, SETTLED)
        self._errors = _GuessErrors(config.max_range_m)
        self._pose, self._step = np.eye(4), np.eye(4)

    def expect(self, step: Pose2) -> None:
        """Guess the next step to be this one, which others know, instead of the last one."""
        c, s = math.cos(step.theta), math.sin(step.theta)
        self._step[:2] = [[c, -s, 0.0, step.x], [s, c, 0.0, step.y]]

    def match(self, points: Floats) -> Pose2:
        """Match a scan of (n, 2) `points` in base_link, m, to those before it; returns T_odom_base."""
        away_m = np.hypot(points[:, 0], points[:, 1])
        points = points[(away_m > 0) & (away_m < self._max_range_m)]
        thinned = self._map.thinned(np.column_stack([points, np.zeros(len(points))]))
        guess = self._pose @ self._step
        pose = self._map.align(self._map.keypoints(thinned), guess, self._errors.rms_m)
        self._errors.add(np.linalg.inv(guess) @ pose)
        self._map.add(thinned, pose)
        self._step, self._pose = np.linalg.inv(self._pose) @ pose, pose
        return Pose2.in_plane(pose)


class _GuessErrors:
    """How far points were off at the guesses, root mean square: KISS-ICP's adaptive threshold (section III-C)."""

    def __init__(self, max_range_m: float) -> None:
        self._max_range_m = max_range_m
        self._squares_m2, self._count = FIRST_ERROR_M**2, 1

    @property
    def rms_m(self) -> float:
        """The scale of the errors to expect at the next guess, m."""
        return math.sqrt(self._squares_m2 / self._count)

    def add(self, T_guess_found: Floats) -> None:
        """Add the pose (4, 4) that was found from a guess; small errors do not count, or the threshold would vanish."""
        x_m, y_m = T_guess_found[:2, 3].tolist()
        turned_m = 2 * self._max_range_m * math.sin(_half_turn(T_guess_found))
        error_m = math.sqrt(x_m * x_m + y_m * y_m) + turned_m
        if error_m > LEAST_ERROR_M:
            self._squares_m2 += error_m * error_m
            self._count += 1


def _half_turn(T: Floats) -> float:
    """Half of the angle (rad, 0 to pi) by which a pose (4, 4) is turned about z."""
    cosines, sines = float(T[0, 0] + T[1, 1]), float(T[1, 0] - T[0, 1])
    w = z = 0.0
    for _ in range(2):  # from matrix to quaternion, back, and again, as KISS-ICP does: the same result to the last bit
        root = math.sqrt(cosines + 1.0 + 1.0)
        w, z = 0.5 * root, sines * (0.5 / root)
        cosines, sines = 2 * (1 - 2 * z * z), 4 * z * w
    return math.atan2(abs(z), w)
