"""The factors of the graph, as gtsam takes them. Covariances come in (x, y, theta) of the earlier pose, m and rad."""

import math
from collections.abc import Callable

import gtsam
import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.backend.wheel_calibration import WheelMotion

CALIBRATION = gtsam.symbol("c", 0)


def pose_key(keyframe: int) -> int:
    """gtsam's key of a keyframe's pose."""
    return int(gtsam.symbol("x", keyframe))


def in_b(covariance: Floats, theta_a_b: float) -> Floats:
    """A covariance (3, 3) of T_a_b in the axes of a, in the axes of b (where gtsam's tangent space lies)."""
    c, s = math.cos(theta_a_b), math.sin(theta_a_b)
    R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    turned: Floats = R @ covariance @ R.T
    return turned


def between_factor(a: int, b: int, T_a_b: Pose2, covariance: Floats) -> gtsam.NonlinearFactor:
    """The constraint that keyframe b stands at `T_a_b` in keyframe a."""
    noise = gtsam.noiseModel.Gaussian.Covariance(in_b(covariance, T_a_b.theta))
    return gtsam.BetweenFactorPose2(pose_key(a), pose_key(b), gtsam.Pose2(T_a_b.x, T_a_b.y, T_a_b.theta), noise)


def wheel_factor(a: int, b: int, motion: WheelMotion, covariance: Floats) -> gtsam.NonlinearFactor:
    """The constraint between two keyframes and the wheels' calibration (see wheel_calibration)."""
    keys = [pose_key(a), pose_key(b), CALIBRATION]
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
    return gtsam.CustomFactor(noise, keys, _wheel_error(keys, motion))


def _wheel_error(keys: list[int], motion: WheelMotion) -> Callable[..., Floats]:
    turn = np.array([0.0, motion.pose.theta, motion.path_m, motion.seconds])

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[Floats] | None) -> Floats:
        calibration = values.atVector(keys[2])
        T_a_b = values.atPose2(keys[0]).between(values.atPose2(keys[1]))
        expected = motion.corrected(calibration)
        x, y, theta = T_a_b.x(), T_a_b.y(), T_a_b.theta()
        if jacobians is not None:
            c, s = math.cos(theta), math.sin(theta)
            # d(x, y, theta) of T_a_b by a right perturbation of a: -Ad, mapped to the axes of a, is this directly
            jacobians[0] = np.array([[-1.0, 0.0, y], [0.0, -1.0, -x], [0.0, 0.0, -1.0]], order="F")
            jacobians[1] = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], order="F")
            by_calibration = np.zeros((3, 4), order="F")
            by_calibration[0] = 0.5 * expected.y * turn
            by_calibration[1] = -0.5 * expected.x * turn
            by_calibration[2] = -turn
            by_calibration[0, 0] -= expected.x / (1 + calibration[0])
            by_calibration[1, 0] -= expected.y / (1 + calibration[0])
            jacobians[2] = by_calibration
        return np.array([x - expected.x, y - expected.y, wrap(theta - expected.theta)])

    return error
