"""The batch pose graph of odometry and closures (the paper's pose graph equation).

The covariance of closures is the identity, in m and rad, as in the paper. The paper gives none for the odometry, which
determines the accuracy; the one here is of uncalibrated wheels.
"""

from collections.abc import Sequence

import gtsam
import numpy as np

from wayfi.backend.pose2 import Floats, between_all
from wayfi.service.reproduction.similarity_model import Distances
from wayfi.service.reproduction.wifi_closures import Closures

ITERATIONS = 100
STEP_SIGMAS = np.array([0.1, 0.1, 0.02])  # m, m, rad between two WiFi scans; real wheels err by 0.026 rad/m
FIRST_SIGMA = 1e-3  # m and rad: the first pose is the origin


def optimise(poses: Floats, closures: Sequence[Closures], distances: Distances | None = None) -> Floats:
    """The optimised poses (n, 3), given the odometry `poses` (n, 3), `closures` and `distances`.

    Levenberg-Marquardt, starting from the odometry.
    """
    graph = _odometry_graph(poses)
    for group in closures:
        _add_closures(graph, group, gtsam.noiseModel.Unit.Create(3))
    if distances is not None:
        _add_distances(graph, distances)
    values = gtsam.Values()
    for number, pose in enumerate(poses):
        values.insert(number, gtsam.Pose2(*pose))
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setMaxIterations(ITERATIONS)
    result = gtsam.LevenbergMarquardtOptimizer(graph, values, parameters).optimize()
    optimised: Floats = gtsam.utilities.extractPose2(result)
    return optimised


def _odometry_graph(poses: Floats) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph()
    first = gtsam.noiseModel.Isotropic.Sigma(3, FIRST_SIGMA)
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*poses[0]), first))
    steps = np.arange(len(poses) - 1)
    driven = Closures(np.stack([steps, steps + 1], axis=1), between_all(poses[:-1], poses[1:]))
    _add_closures(graph, driven, gtsam.noiseModel.Diagonal.Sigmas(STEP_SIGMAS))
    return graph


def _add_closures(graph: gtsam.NonlinearFactorGraph, closures: Closures, noise: gtsam.noiseModel.Base) -> None:
    for (a, b), T_a_b in zip(closures.pairs.tolist(), closures.T_a_b.tolist(), strict=True):
        graph.add(gtsam.BetweenFactorPose2(a, b, gtsam.Pose2(*T_a_b), noise))


def _add_distances(graph: gtsam.NonlinearFactorGraph, distances: Distances) -> None:
    columns = (distances.pairs.tolist(), distances.distance_m.tolist(), distances.sigma_m.tolist())
    for (a, b), distance_m, sigma_m in zip(*columns, strict=True):
        graph.add(gtsam.RangeFactorPose2(a, b, distance_m, gtsam.noiseModel.Isotropic.Sigma(1, sigma_m)))
