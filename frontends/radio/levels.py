"""The level of an access point over a building, with its uncertainty: Gaussian-process regression about the path loss.

What was not heard is below the limit: a site of expectation propagation for each place (Rasmussen and Williams 2006,
3.6), which makes it an observation with a level and a variance of its own.
"""

import math
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.radio.propagation import Heard, distances, loss_terms, prior, shadow_covariance
from wayfi.frontends.radio.radio_config import RadioConfig

EP_PASSES = 6
DAMPING = 0.7
LEAST_PRECISION = 1e-4  # dB^-2: a site that says less is left out


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """(n,) `level` dBm at cells, and its standard deviation `sigma` dB."""

    level: Floats
    sigma: Floats


class _Process:
    """The Gaussian process of an access point at `position`, or at an unknown one (None) about a mean level."""

    def __init__(self, position: Floats | None, typical_dbm: float, config: RadioConfig) -> None:
        self._position, self._typical_dbm, self._config = position, typical_dbm, config
        self._loss, self._loss_sigma = prior(config)

    def terms(self, xy: Floats) -> Floats:
        """(n, k) the terms of the mean at `xy` (n, 2), times the standard deviations of their factors."""
        if self._position is None:
            return np.full((len(xy), 1), self._config.power_sigma_db)
        return self._loss_terms(xy).T * self._loss_sigma

    def mean(self, xy: Floats) -> Floats:
        """(n,) dBm, before anything was heard."""
        if self._position is None:
            return np.full(len(xy), self._typical_dbm)
        return np.asarray(self._loss @ self._loss_terms(xy))

    def covariance(self, a: Floats, b: Floats) -> Floats:
        """(n, m) dB^2 between the levels at `a` (n, 2) and `b` (m, 2)."""
        return shadow_covariance(distances(a, b), self._config) + self.terms(a) @ self.terms(b).T

    def variance(self, xy: Floats) -> Floats:
        """(n,) dB^2, before anything was heard."""
        return np.asarray(self._config.shadow_db**2 + (self.terms(xy) ** 2).sum(axis=1))

    def _loss_terms(self, xy: Floats) -> Floats:
        assert self._position is not None
        return loss_terms(distances(xy, self._position[None])[:, 0], self._config)


def levels(heard: Heard, position: Floats | None, cells: Floats, config: RadioConfig) -> Levels:
    """The level of an access point at `position`, if that is known, at `cells` (n, 2) m."""
    process = _Process(position, float(heard.level.mean()), config)
    xy, level, variance = _with_silence(heard, process, config)
    whitening = _whitening(process.covariance(xy, xy) + np.diag(variance))
    across = whitening @ process.covariance(xy, cells)
    mean = process.mean(cells) + (whitening @ (level - process.mean(xy))) @ across
    left = process.variance(cells) - np.einsum("oc,oc->c", across, across)
    return Levels(mean, np.sqrt(np.maximum(left, 0.0)))


def _with_silence(heard: Heard, process: _Process, config: RadioConfig) -> tuple[Floats, Floats, Floats]:
    """The places, levels and variances of `heard`, with an observation for each place that says that it was silent."""
    if not len(heard.silent_xy):
        return heard.xy, heard.level, heard.variance
    whitening = _whitening(process.covariance(heard.xy, heard.xy) + np.diag(heard.variance))
    across = whitening @ process.covariance(heard.xy, heard.silent_xy)
    mean = process.mean(heard.silent_xy) + (whitening @ (heard.level - process.mean(heard.xy))) @ across
    covariance = process.covariance(heard.silent_xy, heard.silent_xy) - across.T @ across
    level, precision = _silent_sites(mean, covariance, heard.limit_dbm, config.fading_db)
    kept = precision > LEAST_PRECISION
    return (
        np.vstack([heard.xy, heard.silent_xy[kept]]),
        np.concatenate([heard.level, level[kept]]),
        np.concatenate([heard.variance, 1.0 / precision[kept]]),
    )


def _silent_sites(mean: Floats, covariance: Floats, limit_dbm: float, fading_db: float) -> tuple[Floats, Floats]:
    """(c,) levels and precisions of observations that stand for being silent, given `mean` and `covariance`."""
    precision, shift = np.zeros(len(mean)), np.zeros(len(mean))
    prior_variance = np.maximum(np.diag(covariance), 1e-6)
    marginal, variance = mean, prior_variance
    for _ in range(EP_PASSES):
        cavity = 1.0 / np.maximum(1.0 / variance - precision, 1e-6)
        cavity_mean = cavity * (marginal / variance - shift)
        moved, narrowed = _moments_below(cavity_mean, cavity, limit_dbm, fading_db)
        wanted = np.maximum(1.0 / narrowed - 1.0 / cavity, 0.0)
        precision = (1 - DAMPING) * precision + DAMPING * wanted
        shift = (1 - DAMPING) * shift + DAMPING * (moved * (wanted + 1.0 / cavity) - cavity_mean / cavity)
        root = np.sqrt(precision)
        gain = _whitening(np.eye(len(mean)) + root[:, None] * covariance * root) @ (root[:, None] * covariance)
        posterior = covariance - gain.T @ gain
        marginal = mean + posterior @ (shift - precision * mean)
        variance = np.maximum(np.diag(posterior), 1e-6)
    return np.where(precision > 0, shift / np.maximum(precision, 1e-12), mean), precision


def _moments_below(mean: Floats, variance: Floats, limit_dbm: float, fading_db: float) -> tuple[Floats, Floats]:
    """The (c,) means and variances of levels that are known to be below a limit, but for fading."""
    spread = np.sqrt(variance + fading_db**2)
    z = np.clip((limit_dbm - mean) / spread, -20.0, 20.0)
    below = np.array([0.5 * math.erfc(-value / math.sqrt(2.0)) for value in z.tolist()])
    ratio = np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi) / below
    return mean - variance * ratio / spread, variance - variance**2 * ratio * (z + ratio) / spread**2


def _whitening(covariance: Floats) -> Floats:
    """The inverse of the lower Cholesky root."""
    return np.linalg.inv(np.linalg.cholesky(covariance))
