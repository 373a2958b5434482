"""The rigid motion between two sequences of points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.pose2 import Pose2, wrap
from wayfi.service.reproduction.rigid_motion import mean_residual, rigid_motion

POSES = st.builds(Pose2, st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3))


@settings(deadline=None)
@given(POSES, st.integers(0, 2**31), st.integers(2, 30))
def test_a_rigid_motion_is_recovered(T: Pose2, seed: int, n: int) -> None:
    source = np.random.default_rng(seed).uniform(-10, 10, (n, 2))
    found = rigid_motion(source, T.transform(source))
    assert Pose2.of(found).distance(T) < 1e-6
    assert abs(wrap(found[2] - T.theta)) < 1e-6
    assert mean_residual(found, source, T.transform(source)) < 1e-6


def test_no_motion_fits_noisy_points_better_than_the_one_found() -> None:
    rng = np.random.default_rng(0)
    source = rng.uniform(-5, 5, (30, 2))
    target = Pose2(1.0, 2.0, 0.5).transform(source) + rng.normal(0, 0.3, source.shape)
    T = rigid_motion(source, target)

    def cost(dx: float = 0.0, dy: float = 0.0, dtheta: float = 0.0) -> float:
        moved = Pose2.of(T + np.array([dx, dy, dtheta])).transform(source)
        return float(((moved - target) ** 2).sum())

    for e in (-1e-3, 1e-3):
        assert cost() < min(cost(dx=e), cost(dy=e), cost(dtheta=e))


def test_the_residual_is_the_mean_distance_that_is_left() -> None:
    source = np.array([[0.0, 0.0], [1.0, 0.0]])
    assert mean_residual(np.array([0.0, 3.0, np.pi / 2]), source, np.zeros((2, 2))) == pytest.approx((3.0 + 4.0) / 2)
