"""How radio waves fade in a building: path loss, and the Gaussian process of shadowing about it.

level(x) = P - 10 n log10(d) - a d + shadowing(x) + fading, with the distance d to the access point, the power P at 1 m,
the exponent n (the log-distance model), and the attenuation a of walls in a row (Devasirvatham et al. 1990). Shadowing
is alike over some metres (Gudmundson 1991); its covariance is Matern's of order 3/2.
"""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.radio.radio_config import RadioConfig


@dataclass(frozen=True, slots=True, eq=False)
class Heard:
    """What is known of one access point: its `level` (m,) dBm with `variance` (m,) dB^2 at `xy` (m, 2) m in map.

    At `silent_xy` (c, 2) it was not heard, though robots were there: it is below `limit_dbm`.
    """

    xy: Floats
    level: Floats
    variance: Floats
    silent_xy: Floats
    limit_dbm: float


def distances(a: Floats, b: Floats) -> Floats:
    """(n, m) m between points `a` (n, 2) and `b` (m, 2)."""
    return np.asarray(np.hypot(a[:, None, 0] - b[None, :, 0], a[:, None, 1] - b[None, :, 1]))


def shadow_covariance(distance_m: Floats, config: RadioConfig) -> Floats:
    """dB^2 between the shadowing of points that far apart."""
    scaled = np.sqrt(3.0) / config.shadow_m * distance_m
    return np.asarray(config.shadow_db**2 * (1.0 + scaled) * np.exp(-scaled))


def loss_terms(distance_m: Floats, config: RadioConfig) -> Floats:
    """(3, ...) what P, n and a are multiplied with, to give the level at that distance along the floor."""
    d = np.maximum(np.hypot(distance_m, config.height_m), 1.0)
    return np.stack([np.ones_like(d), -10.0 * np.log10(d), -d])


def prior(config: RadioConfig) -> tuple[Floats, Floats]:
    """(3,) mean of P, n and a before anything was heard, and their (3,) standard deviations."""
    mean = np.array([config.power_dbm, config.exponent, config.attenuation_db_per_m])
    return mean, np.array([config.power_sigma_db, config.exponent_sigma, config.attenuation_sigma])
