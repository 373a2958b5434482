"""The search over turn biases: the one that was driven with wins, doubtful closures and all."""

import math

import numpy as np
import pytest

from wayfi.backend.pose2 import Floats
from wayfi.backend.wheel_calibration import WheelCalibration, dead_reckoning
from wayfi.frontends.calibration_search import SearchConfig, best_mode, cost_of

PRIOR = WheelCalibration(np.zeros(4), np.array([0.01, 0.03, 0.02, 0.0005]))
CONFIG = SearchConfig()
SIGMA_M = 1.5


def rounds(bias: float, n: int = 240, per_round: int = 80, seed: int = 0) -> Floats:
    """(n, 5) motions that wheels with a turn `bias` (rad/m) tell of rounds of 40 m."""
    rng = np.random.default_rng(seed)
    turn = 2 * math.pi / per_round
    told = np.tile([0.5, 0.0, turn - 0.5 * bias, 0.5, 1.0], (n, 1))
    told[:, 2] += rng.normal(0, 0.003, n)
    return told


def closures(n: int = 240, every: int = 20) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    return np.array([(k - 80, k) for k in range(80, n + 1, every)])


PATHS = 0.5 * np.arange(241)


@pytest.mark.parametrize("bias", [-0.05, -0.026, 0.0, 0.026, 0.06])
def test_the_bias_that_was_driven_with_is_found(bias: float) -> None:
    mode = best_mode(rounds(bias), closures(), PATHS, SIGMA_M, PRIOR, CONFIG)
    assert abs(mode.values[2] - bias) < 0.004
    assert mode.explained.all()
    np.testing.assert_array_equal(mode.poses, dead_reckoning(rounds(bias), mode.values))
    np.testing.assert_array_equal(np.delete(mode.values, 2), 0)


def test_closures_that_are_wrong_are_outvoted_and_named() -> None:
    wrong = np.array([(0, 40), (10, 45), (30, 150)])
    pairs = np.concatenate([closures(), wrong])
    mode = best_mode(rounds(0.04), pairs, PATHS, SIGMA_M, PRIOR, CONFIG)
    assert abs(mode.values[2] - 0.04) < 0.004
    assert mode.explained.tolist() == [True] * len(closures()) + [False] * len(wrong)


def test_without_closures_the_prior_stands() -> None:
    mode = best_mode(rounds(0.04), np.empty((0, 2), np.int64), PATHS, SIGMA_M, PRIOR, CONFIG)
    assert abs(mode.values[2]) < 1e-12
    assert mode.cost == pytest.approx(0.0, abs=1e-12)


def test_the_cost_of_a_closure_is_its_distance_in_sigmas_which_grow_with_the_path() -> None:
    poses = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [0.0, 0.0, 2.0]])
    paths = np.array([0.0, 50.0, 100.0])
    chi2 = cost_of(poses, np.array([[0, 1], [0, 2]]), paths, SIGMA_M, CONFIG)
    np.testing.assert_allclose(chi2, [(5.0 / (SIGMA_M + CONFIG.drift * 50.0)) ** 2, 0.0])
