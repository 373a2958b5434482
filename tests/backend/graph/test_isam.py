"""iSAM2 with the wheels' calibration: its prior, long chains that Cholesky cannot solve, and the same bits again."""

import numpy as np
from graphs import CLOSURE, PRIOR, drive, loops

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import BetweenFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.pose2 import Pose2


def test_a_long_drive_on_wheels_alone_stays_solvable() -> None:
    """Half-metre steps with one loose calibration between all of them: too ill-conditioned for Cholesky."""
    graph = PoseGraph(BackendConfig(), PRIOR)
    recorded = loops(np.array([0.0, 0.0, 0.025, 0.0]), 10, noise=0.2)
    drive(graph, recorded, {})
    assert graph.keyframes == 801
    assert np.isfinite(graph.covariance(800)).all()
    graph.add(BetweenFactor(720, 800, recorded.truth[720].between(recorded.truth[800]), CLOSURE))
    graph.update()
    assert np.isfinite(graph.poses()).all()


def test_the_same_drive_gives_the_same_estimate_to_the_bit() -> None:
    recorded = loops(np.array([0.0, 0.0, 0.02, 0.0]), 2)
    graphs = [PoseGraph(BackendConfig(), PRIOR) for _ in range(2)]
    for graph in graphs:
        drive(graph, recorded, {k: k - 80 for k in range(80, 161, 20)})
        graph.settle()
    np.testing.assert_array_equal(graphs[0].poses(), graphs[1].poses())
    np.testing.assert_array_equal(graphs[0].calibration().values, graphs[1].calibration().values)
    np.testing.assert_array_equal(graphs[0].covariance(160), graphs[1].covariance(160))


def test_a_given_calibration_is_the_prior() -> None:
    prior = WheelCalibration(np.array([0.01, 0.0, 0.02, 0.0]), np.array([1e-3, 1e-3, 1e-3, 1e-5]))
    graph = PoseGraph(BackendConfig(), prior)
    graph.add_keyframe(Pose2())
    graph.update()
    found = graph.calibration()
    np.testing.assert_allclose(found.values, prior.values, atol=1e-12)
    np.testing.assert_allclose(found.sigmas, prior.sigmas, rtol=1e-6)
