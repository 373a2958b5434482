"""The errors of closures."""

import numpy as np
import pytest

from wayfi.backend.pose2 import between_all, compose_all
from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.reproduction.sweep_figures import closure_errors


def test_closures_are_scored_against_the_truth() -> None:
    poses = np.random.default_rng(0).uniform(-3.0, 3.0, (144, 3))
    truth = Trajectory(np.arange(144, dtype=np.int64) * SECOND_NS, poses)
    stamps_ns = truth.stamps_ns[np.array([(0, 100), (5, 60), (7, 90)])]
    true = between_all(truth.at(stamps_ns[:, 0]), truth.at(stamps_ns[:, 1]))
    off = compose_all(true, np.array([[0.3, 0.4, 0.1], [0.0, 1.5, -0.3], [0.0, 0.0, 0.0]]))
    assert closure_errors(stamps_ns, off, truth) == pytest.approx((2.0 / 3, 0.4 / 3))
    claimed = np.array([True, False, True])
    assert closure_errors(stamps_ns, off, truth, claimed) == pytest.approx((2.0 / 3, 0.05))
    assert closure_errors(stamps_ns + 10**15, off, truth) == (None, None)
