"""Where an access point stands: the posterior of its position on a grid, by path loss and correlated shadowing.

For each position P, n and a are marginalised: exactly for what was heard, by Laplace's approximation for where nothing
was. Shadowing is correlated, so that a hundred readings in one room do not count as a hundred.
"""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.radio.propagation import Heard, distances, loss_terms, prior, shadow_covariance
from wayfi.frontends.radio.radio_config import RadioConfig

COARSE_M, FINE = 4.0, 4  # m between the positions that are tried first; so many per axis in each that stays likely
LIKELY = 10.0  # in log odds, below the best: a fortieth of a per mille
MOST_REFINED = 150  # where more positions are likely, the coarse grid is fine enough
NEWTON_STEPS = 5
LOGISTIC_SIGMA = 1.7  # a logistic curve of scale 1 is that of a normal distribution of this sigma


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """Mean `xy` (2,) m in map and `covariance` (2, 2) m^2 of a position; `log_evidence` is that of the readings.

    `likeliest` (2,) m is the most likely position. `misfit` is the mean squared residual of the levels in standard
    deviations, 1 or less where the model holds.
    """

    xy: Floats
    covariance: Floats
    likeliest: Floats
    log_evidence: float
    misfit: float


class _Likelihood:
    """The likelihood of positions, given what was heard of an access point."""

    def __init__(self, heard: Heard, config: RadioConfig) -> None:
        self._heard, self._config = heard, config
        K = shadow_covariance(distances(heard.xy, heard.xy), config) + np.diag(heard.variance)
        root = np.linalg.cholesky(K)
        self._whitening = np.linalg.inv(root)
        self._level = self._whitening @ heard.level
        self._log_det = 2.0 * float(np.log(np.diag(root)).sum())
        self._mean, self._sigma = prior(config)
        near = shadow_covariance(distances(heard.silent_xy, heard.silent_xy), config) / config.shadow_db**2
        self._silent_weight = 1.0 / near.sum(axis=1)  # as many as are independent of each other
        self._scale = np.hypot(config.shadow_db, config.fading_db) / LOGISTIC_SIGMA

    def of(self, positions: Floats) -> tuple[Floats, Floats]:
        """(g,) log likelihood of `positions` (g, 2), and (g, 3) the P, n and a that fit best there."""
        terms = loss_terms(distances(self._heard.xy, positions), self._config)
        white = np.einsum("ij,kjg->kig", self._whitening, terms, optimize=True)
        precision = np.diag(self._sigma**-2)
        information = np.einsum("kig,lig->gkl", white, white, optimize=True) + precision
        target = np.einsum("kig,i->gk", white, self._level, optimize=True) + precision @ self._mean
        constant = float(self._level @ self._level + self._mean @ precision @ self._mean)
        silent = loss_terms(distances(self._heard.silent_xy, positions), self._config)
        loss = np.linalg.solve(information, target[:, :, None])[:, :, 0]
        for _ in range(NEWTON_STEPS if silent.shape[1] else 0):
            loss = loss + self._newton_step(loss, information, target, silent)
        excess = self._excess(loss, silent)
        curvature = information + self._silent_curvature(excess, silent)
        quadratic = np.einsum("gk,gkl,gl->g", loss, information, loss) - 2 * (target * loss).sum(axis=1) + constant
        log_silent = -(self._silent_weight[:, None] * np.logaddexp(0.0, excess)).sum(axis=0)
        log_volume = np.linalg.slogdet(curvature)[1] + 2 * np.log(self._sigma).sum()
        count = len(self._level) * np.log(2 * np.pi)
        return log_silent - 0.5 * (quadratic + log_volume + self._log_det + count), loss

    def misfit(self, position: Floats, loss: Floats) -> float:
        """The mean squared whitened residual."""
        terms = loss_terms(distances(self._heard.xy, position[None]), self._config)[:, :, 0]
        return float(np.mean((self._level - self._whitening @ (loss @ terms)) ** 2))

    def _excess(self, loss: Floats, silent: Floats) -> Floats:
        """(c, g) by how much an access point should be above what is heard, where it was not heard."""
        return np.asarray((np.einsum("gk,kcg->cg", loss, silent) - self._heard.limit_dbm) / self._scale)

    def _silent_curvature(self, excess: Floats, silent: Floats) -> Floats:
        heard = 1.0 / (1.0 + np.exp(-np.clip(excess, -50.0, 50.0)))
        weight = self._silent_weight[:, None] * heard * (1.0 - heard) / self._scale**2
        return np.asarray(np.einsum("kcg,lcg,cg->gkl", silent, silent, weight, optimize=True))

    def _newton_step(self, loss: Floats, information: Floats, target: Floats, silent: Floats) -> Floats:
        excess = self._excess(loss, silent)
        heard = 1.0 / (1.0 + np.exp(-np.clip(excess, -50.0, 50.0)))
        slope = target - np.einsum("gkl,gl->gk", information, loss)
        slope -= np.einsum("kcg,cg->gk", silent, self._silent_weight[:, None] * heard / self._scale)
        curvature = information + self._silent_curvature(excess, silent)
        return np.asarray(np.linalg.solve(curvature, slope[:, :, None])[:, :, 0])


def place(heard: Heard, bounds: tuple[Floats, Floats], config: RadioConfig) -> Placed:
    """The position of an access point, anywhere within `bounds` (the lowest and the highest x, y)."""
    likelihood = _Likelihood(heard, config)
    low, high = bounds
    axes = [np.arange(low[k] + COARSE_M / 2, high[k] + COARSE_M / 2, COARSE_M) for k in range(2)]
    positions = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    log, loss = likelihood.of(positions)
    likely, step = log > log.max() - LIKELY, COARSE_M
    if np.count_nonzero(likely) <= MOST_REFINED:
        step = COARSE_M / FINE
        inner = (np.arange(FINE) - (FINE - 1) / 2) * step
        offsets = np.stack(np.meshgrid(inner, inner, indexing="ij"), axis=-1).reshape(-1, 2)
        positions = (positions[likely][:, None] + offsets).reshape(-1, 2)
        log, loss = likelihood.of(positions)
    best = int(np.argmax(log))
    weight = np.exp(log - log[best])
    evidence = float(log[best] + np.log(weight.sum() * step**2 / float(np.prod(high - low))))
    weight /= weight.sum()
    mean = weight @ positions
    away = positions - mean
    covariance = (weight[:, None] * away).T @ away + np.eye(2) * step**2 / 12
    return Placed(mean, covariance, positions[best], evidence, likelihood.misfit(positions[best], loss[best]))
