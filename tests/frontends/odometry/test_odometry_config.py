"""The prior of the wheels' calibration."""

import numpy as np

from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior

CONFIG = OdometryConfig()


def test_what_is_believed_of_the_wheels_before_a_drive_is_nothing_but_its_sigmas() -> None:
    prior = calibration_prior(CONFIG)
    np.testing.assert_array_equal(prior.values, 0)
    assert prior.sigmas.tolist() == [
        CONFIG.prior_distance_scale,
        CONFIG.prior_turn_scale,
        CONFIG.prior_turn_bias_rad_per_m,
        CONFIG.prior_turn_bias_rad_per_s,
    ]
