"""The covariance of the random part of the wheels' odometry."""

import numpy as np

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats
from wayfi.frontends.odometry.odometry_config import OdometryConfig

LEAST_VARIANCE_RAD2 = 1e-8  # (0.1 mrad)^2: the covariance of a motion without any path stays positive definite


def wheel_covariance(motion: WheelMotion, config: OdometryConfig, covariance_scale: float = 1.0) -> Floats:
    """(3, 3) covariance of the random part of `motion` in (x, y, theta); `covariance_scale` multiplies it.

    A heading error e that builds up along the way leaves e / 2 of the length to the side: hence the y, theta terms.
    """
    length = motion.path_m
    var_xy = config.sigma_xy_per_sqrt_m**2 * length + config.sigma_still_m**2
    var_theta = (
        config.sigma_theta_per_sqrt_m**2 * length
        + config.sigma_theta_per_sqrt_rad**2 * abs(motion.pose.theta)
        + config.sigma_still_rad**2
    )
    x, y = motion.pose.x, motion.pose.y
    lever_x, lever_y = -0.5 * y, 0.5 * x
    unknown_m2 = motion.discontinuities * config.sigma_restart_m**2 + motion.open_m2
    restarted_rad2 = motion.discontinuities * config.sigma_restart_rad**2
    xx = covariance_scale * (var_xy + var_theta * (lever_x * lever_x)) + unknown_m2
    xy = covariance_scale * (var_theta * (lever_x * lever_y))
    yy = covariance_scale * (var_xy + var_theta * (lever_y * lever_y)) + unknown_m2
    xt, yt = covariance_scale * (var_theta * lever_x), covariance_scale * (var_theta * lever_y)
    tt = covariance_scale * var_theta + (LEAST_VARIANCE_RAD2 + restarted_rad2)
    return np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
