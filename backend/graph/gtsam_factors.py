"""The graph's factors as gtsam's. Their covariances are in (x, y, theta) of keyframe a, m and rad."""

import math
from collections.abc import Callable

import gtsam
import numpy as np

from wayfi.backend.graph.factors import AxisFactor, BetweenFactor, Factor, NearFactor, WheelFactor
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2, covariance_in_b, wrap

ORIGIN_SIGMA = 1e-4  # m and rad: a five-hundredth of a grid cell, and not so tight that the equations suffer


def pose_key(keyframe: int) -> int:
    """gtsam's key of a keyframe's pose."""
    return int(gtsam.symbol("x", keyframe))


def calibration_key(stretch: int) -> int:
    """gtsam's key of the wheels' calibration on a stretch of the path."""
    return int(gtsam.symbol("c", stretch))


def axes_key(state: int) -> int:
    """gtsam's key of the direction of a building's axes, a vector of one number."""
    return int(gtsam.symbol("d", state))


def gtsam_factor(factor: Factor, stretch: int, axes: int) -> gtsam.NonlinearFactor:
    """The factor, with the wheels' calibration on `stretch` and the state `axes` of the building's as unknowns."""
    if isinstance(factor, AxisFactor):
        return axis_factor(factor, axes)
    if isinstance(factor, BetweenFactor):
        return between_factor(factor.a, factor.b, factor.T_a_b, factor.covariance)
    if isinstance(factor, NearFactor):
        return near_factor(factor, stretch)
    return wheel_factor(factor, stretch)


def calibrated_factor(factor: Factor, stretch: int, axes: int, calibration: Floats) -> gtsam.NonlinearFactor:
    """The factor with a known calibration (4,): a wheel factor is then gtsam's own BetweenFactor, many times faster."""
    if isinstance(factor, WheelFactor):
        return between_factor(factor.a, factor.b, factor.motion.corrected(calibration), factor.covariance)
    return gtsam_factor(factor, stretch, axes)


def origin_factor(origin: Pose2) -> gtsam.NonlinearFactor:
    """The prior that the first keyframe is at `origin` in `map`."""
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.full(3, ORIGIN_SIGMA))
    return gtsam.PriorFactorPose2(pose_key(0), gtsam.Pose2(origin.x, origin.y, origin.theta), noise)


def walk_factor(stretch: int, sigmas: Floats) -> gtsam.NonlinearFactor:
    """The random walk of the wheels' calibration from the stretch before, with `sigmas` (4,) of its step."""
    noise = gtsam.noiseModel.Diagonal.Sigmas(sigmas)
    return gtsam.BetweenFactorVector(calibration_key(stretch - 1), calibration_key(stretch), np.zeros(4), noise)


def axes_walk(before: int, state: int, sigma_rad: float) -> gtsam.NonlinearFactor:
    """The random walk of the direction of the axes from the state `before` it."""
    noise = gtsam.noiseModel.Isotropic.Sigma(1, sigma_rad)
    return gtsam.BetweenFactorVector(axes_key(before), axes_key(state), np.zeros(1), noise)


def axes_prior(state: int, direction: float, sigma_rad: float) -> gtsam.NonlinearFactor:
    """The prior of the `direction` (rad) of the axes of a new wing."""
    return gtsam.PriorFactorVector(
        axes_key(state), np.array([direction]), gtsam.noiseModel.Isotropic.Sigma(1, sigma_rad)
    )


def axis_factor(factor: AxisFactor, state: int) -> gtsam.NonlinearFactor:
    """The constraint between a keyframe's heading and the direction of the axes."""
    keys = [pose_key(factor.b), axes_key(state)]
    noise = gtsam.noiseModel.Isotropic.Sigma(1, factor.sigma_rad)
    return gtsam.CustomFactor(noise, keys, _axis_error(keys, factor.turned))


def _axis_error(keys: list[int], turned: float) -> Callable[..., Floats]:
    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[Floats] | None) -> Floats:
        if jacobians is not None:
            jacobians[0] = np.array([[0.0, 0.0, 1.0]], order="F")
            jacobians[1] = np.array([[-1.0]], order="F")
        direction = float(values.atVector(keys[1])[0])
        return np.array([wrap(values.atPose2(keys[0]).theta() - direction - turned)])

    return error


def between_factor(a: int, b: int, T_a_b: Pose2, covariance: Floats) -> gtsam.NonlinearFactor:
    """The constraint that the pose of keyframe b in keyframe a is `T_a_b`."""
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance_in_b(covariance, T_a_b.theta))
    return gtsam.BetweenFactorPose2(pose_key(a), pose_key(b), gtsam.Pose2(T_a_b.x, T_a_b.y, T_a_b.theta), noise)


def wheel_factor(factor: WheelFactor, stretch: int) -> gtsam.NonlinearFactor:
    """The constraint between two keyframes and the wheels' calibration (see wheel_calibration)."""
    keys = [pose_key(factor.a), pose_key(factor.b), calibration_key(stretch)]
    noise = gtsam.noiseModel.Gaussian.Covariance(factor.covariance)
    return gtsam.CustomFactor(noise, keys, _wheel_error(keys, factor.motion, factor.alone))


def _wheel_error(keys: list[int], motion: WheelMotion, alone: bool) -> Callable[..., Floats]:
    turn = np.array([0.0, motion.pose.theta, motion.path_m, motion.seconds])

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[Floats] | None) -> Floats:
        calibration = values.atVector(keys[2])
        T_a_b = values.atPose2(keys[0]).between(values.atPose2(keys[1]))
        expected = motion.corrected(calibration)
        u, du = (1 / (1 + calibration[0]), -1 / (1 + calibration[0]) ** 2) if alone else (1.0, 0.0)
        x, y, theta = T_a_b.x(), T_a_b.y(), T_a_b.theta()
        if jacobians is not None:
            c, s = math.cos(theta), math.sin(theta)
            # d(x, y, theta) of T_a_b by a right perturbation of a: -Ad, mapped to the axes of a, is this directly
            jacobians[0] = np.array([[-u, 0.0, u * y], [0.0, -u, -u * x], [0.0, 0.0, -1.0]], order="F")
            jacobians[1] = np.array([[u * c, -u * s, 0.0], [u * s, u * c, 0.0], [0.0, 0.0, 1.0]], order="F")
            J_calibration = np.zeros((3, 4), order="F")
            J_calibration[0] = 0.5 * u * expected.y * turn
            J_calibration[1] = -0.5 * u * expected.x * turn
            J_calibration[2] = -turn
            J_calibration[0, 0] = du * (x - expected.x) - u * expected.x / (1 + calibration[0])
            J_calibration[1, 0] = du * (y - expected.y) - u * expected.y / (1 + calibration[0])
            jacobians[2] = J_calibration
        return np.array([u * (x - expected.x), u * (y - expected.y), wrap(theta - expected.theta)])

    return error


def near_factor(factor: NearFactor, stretch: int) -> gtsam.NonlinearFactor:
    """The constraint that a place of keyframe a and one of keyframe b are the same.

    Hundreds of distances of 0 m would shrink the map. So the distance between the keyframes is divided by the wheels'
    scale, which makes the constraint independent of that scale. The places within the keyframes do not grow with the
    map: divided as well, those of a hundred pairs driven in opposite directions tell a scale of nearly 1 %.
    """
    keys = [pose_key(factor.a), pose_key(factor.b), calibration_key(stretch)]
    noise = gtsam.noiseModel.Isotropic.Sigma(2, factor.sigma_m)
    return gtsam.CustomFactor(noise, keys, _near_error(keys, factor.place_a, factor.place_b))


def _near_error(keys: list[int], place_a: Floats, place_b: Floats) -> Callable[..., Floats]:
    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[Floats] | None) -> Floats:
        scale = 1.0 + values.atVector(keys[2])[0]
        a, b = values.atPose2(keys[0]), values.atPose2(keys[1])
        R_a, R_b = _rotation(a), _rotation(b)
        way: Floats = np.array([b.x() - a.x(), b.y() - a.y()]) / scale
        if jacobians is not None:
            J_calibration = np.zeros((2, 4), order="F")
            J_calibration[:, 0] = -way / scale
            jacobians[0] = np.asfortranarray(np.column_stack([-R_a / scale, -R_a @ (-place_a[1], place_a[0])]))
            jacobians[1] = np.asfortranarray(np.column_stack([R_b / scale, R_b @ (-place_b[1], place_b[0])]))
            jacobians[2] = J_calibration
        apart: Floats = way + R_b @ place_b - R_a @ place_a
        return apart

    return error


def _rotation(pose: gtsam.Pose2) -> Floats:
    """(2, 2), from the axes of a keyframe to those of `map`."""
    c, s = math.cos(pose.theta()), math.sin(pose.theta())
    return np.array([[c, -s], [s, c]])
