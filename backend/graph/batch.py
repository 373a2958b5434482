"""All keyframes optimised at once, for starting iSAM2 from."""

from collections.abc import Generator, Sequence

import gtsam

from wayfi.backend.graph.axes_chain import AxesChain, AxesStates
from wayfi.backend.graph.calibration_chain import CalibrationChain
from wayfi.backend.graph.factors import Factor
from wayfi.backend.graph.gtsam_factors import calibrated_factor, calibration_key, origin_factor, pose_key
from wayfi.backend.pose2 import Floats, Pose2

FIXED_SIGMA = 1e-6  # of a calibration that is held fixed: 1 mrad of heading over 1 km
SLICE = 256  # factors that are prepared at once: 3 ms
MOST_ITERATIONS = 100  # gtsam's own number; a start far off was seen to need 40
SETTLED = 1e-5  # of the error in one iteration, absolute or relative: gtsam's own number

Work = Generator[int, None, list[Pose2]]
"""Yields how much work each step was, counted in factors prepared (about 12 us each); returns the poses."""


def optimised(
    factors: Sequence[Factor],
    chains: tuple[CalibrationChain, AxesChain],
    calibrations: Floats,
    start: Floats,
    origin: Pose2,
) -> Work:
    """The poses of the keyframes by Levenberg-Marquardt from `start` (n, 3), the `calibrations` (k, 4) held fixed.

    The first keyframe is at `origin`.
    """
    chain, axes = chains
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for stretch, known in enumerate(calibrations):
        fixed = gtsam.noiseModel.Isotropic.Sigma(4, FIXED_SIGMA)
        graph.addPriorVector(calibration_key(stretch), known, fixed)
        values.insert(calibration_key(stretch), known)
    graph.add(origin_factor(origin))
    for keyframe, (x, y, theta) in enumerate(start):
        values.insert(pose_key(keyframe), gtsam.Pose2(x, y, theta))
    yield len(start)
    AxesStates(axes).add(factors, lambda keyframe: float(start[keyframe, 2]), graph, values)
    for first in range(0, len(factors), SLICE):
        for factor in factors[first : first + SLICE]:
            stretch = chain.stretch(factor)
            graph.add(calibrated_factor(factor, stretch, axes.state(factor), calibrations[stretch]))
        yield SLICE
    solver = gtsam.LevenbergMarquardtOptimizer(graph, values)
    for _ in range(MOST_ITERATIONS):
        before = solver.error()
        solver.iterate()
        yield len(factors)
        if before - solver.error() <= SETTLED * max(1.0, before):
            break
    solved = solver.values()
    return [of_gtsam(solved.atPose2(pose_key(keyframe))) for keyframe in range(len(start))]


def of_gtsam(pose: gtsam.Pose2) -> Pose2:
    """gtsam's pose as ours."""
    return Pose2(pose.x(), pose.y(), pose.theta())
