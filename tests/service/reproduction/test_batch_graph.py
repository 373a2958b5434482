"""The batch pose graph: odometry, closures and known distances."""

import numpy as np
import pytest
from reproduced_drives import drifting, ring, trajectory

from wayfi.backend.pose2 import between_all
from wayfi.service.evaluation.trajectory_scores import absolute_error
from wayfi.service.reproduction.batch_graph import STEP_SIGMAS, optimise
from wayfi.service.reproduction.similarity_model import Distances
from wayfi.service.reproduction.wifi_closures import Closures

NO_CLOSURES = Closures(np.zeros((0, 2), np.int64), np.zeros((0, 3)))


def test_without_closures_the_odometry_stays() -> None:
    poses = drifting(ring(1.5), 0.01)
    np.testing.assert_allclose(optimise(poses, [NO_CLOSURES]), poses, atol=1e-6)


def test_true_closures_straighten_a_drive() -> None:
    truth = ring(2)
    poses = drifting(truth, 0.01)
    pairs = np.array([(i, i + 144) for i in range(144)])
    closures = Closures(pairs, between_all(truth[pairs[:, 0]], truth[pairs[:, 1]]))
    before, after = (
        absolute_error(trajectory(p), trajectory(truth)).error.ate_rmse_m for p in (poses, optimise(poses, [closures]))
    )
    assert after < 0.2 * before


def test_a_closure_has_the_identity_for_a_covariance() -> None:
    """Between two poses that the wheels put 1 m apart: the mean of both, weighted by their information."""
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    closures = Closures(np.array([[0, 1]]), np.array([[3.0, 0.0, 0.0]]))
    wheels_weigh = 1.0 / STEP_SIGMAS[0] ** 2
    expected = (wheels_weigh * 1.0 + 1.0 * 3.0) / (wheels_weigh + 1.0)
    np.testing.assert_allclose(optimise(poses, [closures])[1], [expected, 0.0, 0.0], atol=1e-6)


def test_a_known_distance_brings_two_poses_so_far_apart() -> None:
    poses = drifting(ring(2), 0.01)
    stated = Distances(np.array([[0, 144]]), np.array([2.0]), np.array([0.01]))
    estimate = optimise(poses, [], stated)
    assert np.hypot(*(poses[144] - poses[0])[:2]) > 5.0
    assert np.hypot(*(estimate[144] - estimate[0])[:2]) == pytest.approx(2.0, abs=0.05)
