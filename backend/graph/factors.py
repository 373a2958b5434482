"""The factors of the pose graph, and their validation.

gtsam's update keeps a bad factor after it has raised an error, so an invalid one must never reach it.
"""

import math
from dataclasses import dataclass

import numpy as np

from wayfi.backend.errors import WayfiError
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2

SURE_SIGMAS = 3  # a closure that is no further off than so many of its own sigmas is no surprise
SYMMETRY = 1e-6  # relative, of a covariance's two halves: far above rounding, far below what is a mistake


class FactorError(WayfiError):
    """A factor that the graph could not be solved with."""


@dataclass(frozen=True, slots=True)
class BetweenFactor:
    """A relative-pose constraint: T_a_b with its (3, 3) covariance in (x, y, theta) of a, m and rad."""

    a: int
    b: int
    T_a_b: Pose2
    covariance: Floats


@dataclass(frozen=True, slots=True)
class WheelFactor:
    """The wheels' motion from keyframe a to b, with the (3, 3) covariance of its random part in (x, y, theta) of a.

    `alone`: no scan match has measured true metres yet. The covariance is in the wheels' metres then: in true ones, of
    which nothing is known, the smallest map would fit best.
    """

    a: int
    b: int
    motion: WheelMotion
    covariance: Floats
    alone: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class NearFactor:
    """`place_a` (2,) m in keyframe a and `place_b` (2,) m in keyframe b are one place, to `sigma_m` along each axis."""

    a: int
    b: int
    place_a: Floats
    place_b: Floats
    sigma_m: float


@dataclass(frozen=True, slots=True)
class AxisFactor:
    """Keyframe b heads `turned` rad from the direction of the axes of a wing of the building, to `sigma_rad`.

    The direction is an unknown of the wing, numbered from 1.
    """

    b: int
    wing: int
    turned: float
    sigma_rad: float

    @property
    def a(self) -> int:
        """The keyframe itself: it is related to none before."""
        return self.b


@dataclass(frozen=True, slots=True)
class WallFactor(AxisFactor):
    """As walls that a scan saw tell it, rather than the way that was driven."""


RelativeFactor = BetweenFactor | WheelFactor | NearFactor
Factor = RelativeFactor | AxisFactor


def moves_earlier(factor: Factor) -> bool:
    """Whether a factor may move other keyframes than the newest: it says more than one step does."""
    if isinstance(factor, BetweenFactor):
        return abs(factor.a - factor.b) > 1
    return isinstance(factor, NearFactor | AxisFactor)


def distance_m(factor: RelativeFactor, T_map_a: Pose2, T_map_b: Pose2) -> float:
    """How far (m) the positions of two keyframes are from what a factor says, the keyframes at these poses."""
    if isinstance(factor, NearFactor):
        at_a, at_b = T_map_a.transform(factor.place_a[None])[0], T_map_b.transform(factor.place_b[None])[0]
        return math.hypot(*(at_b - at_a))
    T_a_b = factor.T_a_b if isinstance(factor, BetweenFactor) else factor.motion.pose
    return T_map_a.between(T_map_b).distance(T_a_b)


def sigma_m(factor: RelativeFactor) -> float:
    """The standard deviation (m) of a factor's position along each axis, in the mean of both."""
    if isinstance(factor, NearFactor):
        return factor.sigma_m
    return math.sqrt(float(factor.covariance[0, 0] + factor.covariance[1, 1]) / 2)


def surprise_m(factor: Factor, T_map_a: Pose2, T_map_b: Pose2) -> float:
    """How far (m) a loop closure is from these poses, less SURE_SIGMAS of it; 0 for a factor that is none."""
    if isinstance(factor, AxisFactor) or not moves_earlier(factor):
        return 0.0
    return distance_m(factor, T_map_a, T_map_b) - SURE_SIGMAS * sigma_m(factor)


def validate(factor: Factor, keyframes: int) -> None:
    """Raise FactorError if a graph with this number of `keyframes` could not be solved with the factor."""
    name = f"{type(factor).__name__} {factor.a} -> {factor.b}"
    if isinstance(factor, AxisFactor):
        _validate_axis(name, factor, keyframes)
        return
    if not (0 <= factor.a < keyframes and 0 <= factor.b < keyframes) or factor.a == factor.b:
        raise FactorError(f"{name}: both keyframes must be in the graph and differ (it has {keyframes})")
    if isinstance(factor, NearFactor):
        _validate_places(name, factor)
    else:
        _validate_motion(name, factor)
        _validate_covariance(name, factor.covariance)


def _validate_axis(name: str, axis: AxisFactor, keyframes: int) -> None:
    if not 0 <= axis.b < keyframes:
        raise FactorError(f"{name}: its keyframe must be in the graph (it has {keyframes})")
    if not (math.isfinite(axis.turned) and 0 < axis.sigma_rad < math.inf):
        raise FactorError(f"{name}: its heading must be finite, and its sigma finite and above zero")


def _validate_places(name: str, near: NearFactor) -> None:
    if not (np.isfinite([*near.place_a, *near.place_b]).all() and 0 < near.sigma_m < math.inf):
        raise FactorError(f"{name}: its places must be finite, and its sigma finite and above zero")


def _validate_motion(name: str, factor: BetweenFactor | WheelFactor) -> None:
    pose = factor.T_a_b if isinstance(factor, BetweenFactor) else factor.motion.pose
    way = (0.0, 0.0) if isinstance(factor, BetweenFactor) else (factor.motion.path_m, factor.motion.seconds)
    if not pose.is_finite() or not np.isfinite(way).all() or not np.isfinite(factor.covariance).all():
        raise FactorError(f"{name}: its pose, path, time and covariance must be finite")


def _validate_covariance(name: str, covariance: Floats) -> None:
    if covariance.shape != (3, 3) or not np.allclose(covariance, covariance.T, rtol=SYMMETRY):
        raise FactorError(f"{name}: its covariance must be a symmetric 3 x 3 matrix")
    if np.linalg.eigvalsh(covariance)[0] <= 0:
        raise FactorError(f"{name}: its covariance must be positive definite")
