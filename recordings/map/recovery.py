"""What stands in for the damaged files of a map."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from wayfi.backend.graph.factors import BetweenFactor, Factor
from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior
from wayfi.recordings.map.closure_table import KeptClosure

BRIDGE = np.diag([0.05, 0.05, 0.02]) ** 2  # m, rad: the poses are as good as the whole graph was, a step is better


def bridged(factors: Mapping[int, Factor], poses: Floats) -> dict[int, Factor]:
    """The factors, and one by the poses for each step between keyframes that none is left of."""
    steps = {factor.b for factor in factors.values() if factor.b - factor.a == 1}
    bridges = [b for b in range(1, len(poses)) if b not in steps]
    first = max(factors, default=-1) + 1
    made: dict[int, Factor] = {first + n: _step_to(b, poses) for n, b in enumerate(bridges)}
    return dict(factors) | made


def _step_to(b: int, poses: Floats) -> BetweenFactor:
    return BetweenFactor(b - 1, b, Pose2.of(poses[b - 1]).between(Pose2.of(poses[b])), BRIDGE)


def renumbered(closures: Iterable[KeptClosure]) -> list[KeptClosure]:
    """The closures that are left, each with its number among them."""
    return [
        (replace(closure, judged=replace(closure.judged, closure=k)), vetoed)
        for k, (closure, vetoed) in enumerate(closures)
    ]


def calibration_of(calibrations: Floats) -> Calibration:
    """The wheels as they were at the newest keyframe, as uncertain as before a first drive; no receivers."""
    prior = calibration_prior(OdometryConfig())
    values = calibrations[-1] if len(calibrations) else prior.values
    return Calibration(WheelCalibration(values, prior.sigmas), {})
