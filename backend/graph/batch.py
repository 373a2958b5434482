"""All keyframes optimised at once, for starting iSAM2 from."""

import gtsam

from wayfi.backend.graph.axes_chain import AxesChain
from wayfi.backend.graph.calibration_chain import CalibrationChain
from wayfi.backend.graph.factors import Factor
from wayfi.backend.graph.gtsam_factors import calibrated_factor, calibration_key, origin_factor, pose_key
from wayfi.backend.pose2 import Floats, Pose2

FIXED_SIGMA = 1e-6  # of a calibration that is held fixed: 1 mrad of heading over 1 km


def optimised(
    factors: list[Factor], chain: CalibrationChain, axes: AxesChain, calibrations: Floats, start: Floats
) -> list[Pose2]:
    """The poses of the keyframes by Levenberg-Marquardt from `start` (n, 3), the `calibrations` (k, 4) held fixed."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for stretch, known in enumerate(calibrations):
        fixed = gtsam.noiseModel.Isotropic.Sigma(4, FIXED_SIGMA)
        graph.addPriorVector(calibration_key(stretch), known, fixed)
        values.insert(calibration_key(stretch), known)
    graph.add(origin_factor())
    for keyframe, (x, y, theta) in enumerate(start):
        values.insert(pose_key(keyframe), gtsam.Pose2(x, y, theta))
    stretches = [chain.stretch(factor) for factor in factors]
    axes.reset()
    axes.add_states(zip(factors, stretches, strict=True), lambda keyframe: Pose2.of(start[keyframe]), graph, values)
    for factor, stretch in zip(factors, stretches, strict=True):
        graph.add(calibrated_factor(factor, stretch, axes.state(factor, stretch), calibrations[stretch]))
    solved = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    return [of_gtsam(solved.atPose2(pose_key(keyframe))) for keyframe in range(len(start))]


def of_gtsam(pose: gtsam.Pose2) -> Pose2:
    """gtsam's pose as ours."""
    return Pose2(pose.x(), pose.y(), pose.theta())
