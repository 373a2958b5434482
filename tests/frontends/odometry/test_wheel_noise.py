"""The covariance of the wheels' random errors: sound for any motion, and that of a sampled drive."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.wheel_noise import wheel_covariance

CONFIG = OdometryConfig()


@settings(deadline=None)
@given(st.builds(Pose2, st.floats(-2, 2), st.floats(-2, 2), st.floats(-3, 3)), st.floats(0, 5), st.floats(1, 200))
def test_the_wheels_covariance_is_positive_definite_and_grows_with_its_scale(
    pose: Pose2, path_m: float, covariance_scale: float
) -> None:
    way = WheelMotion(pose, path_m, 1.0)
    covariance = wheel_covariance(way, CONFIG)
    assert np.linalg.eigvalsh(covariance)[0] > 0
    np.testing.assert_array_equal(covariance, covariance.T)
    np.testing.assert_allclose(
        wheel_covariance(way, CONFIG, covariance_scale), covariance_scale * covariance, rtol=1e-6, atol=1e-5
    )


def test_the_wheels_covariance_is_that_of_a_sampled_drive() -> None:
    """Of many small straight steps, each with its own random error, over 2 m."""
    rng = np.random.default_rng(0)
    n, drives = 50, 4000
    step = 2.0 / n
    turn = rng.normal(0, CONFIG.sigma_theta_per_sqrt_m * math.sqrt(step), (drives, n)).cumsum(axis=1)
    along, aside = rng.normal(0, CONFIG.sigma_xy_per_sqrt_m * math.sqrt(step), (2, drives, n))
    x = ((step + along) * np.cos(turn) - aside * np.sin(turn)).sum(axis=1)
    y = ((step + along) * np.sin(turn) + aside * np.cos(turn)).sum(axis=1)
    seen = np.sqrt(np.diag(np.cov(np.stack([x, y, turn[:, -1]]))))
    claimed = np.sqrt(np.diag(wheel_covariance(WheelMotion(Pose2(2.0, 0.0, 0.0), 2.0, 4.0), CONFIG)))
    np.testing.assert_allclose(claimed, seen, rtol=0.1)
