"""Finds the turn bias of the wheels with which most of WiFi's claims hold, before any is accepted.

Wheels that turn by themselves bend the path into a spiral, and a linearised estimate far from the truth settles on the
wrong number of turns. Dead reckoning with one bias gives a rough trajectory of the whole drive, on which the two places
of a claim either meet or lie apart by chance. The evidence of a bias is the likelihood of that mixture of true and
chance claims, over the likelihood that all claims are chance.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.graph.factors import AxisFactor, WheelFactor
from wayfi.backend.graph.wheel_calibration import WheelCalibration, chain, corrected_all
from wayfi.backend.pose2 import Floats
from wayfi.frontends.closures.closure_config import ConsensusConfig

# Shares of true claims at which evidence is computed: within 0.011 nats a claim of the best share from 0.03 to 0.97
TRUE_SHARES = np.array([0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95])
_WRONG = 0.1  # share of headings that may be wrong, as of the samples that are along no axis
FAR_CHI2 = 100.0  # of a pair: its likelihood by then is 1e-22, which no area makes count
_CORRIDOR_M2 = 1.0  # variance added to that of the path, so that a straight one has an area: of 3.5 m, width^2 / 12


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """The pairs of places of claims: `a`, `b` (m,) keyframes, `place_a`, `place_b` (m, 2) m in their frames.

    A pair is one place, to `sigma_m` (m,) along each axis, if its claim is true. `path_m` (m,) were driven in between.
    A claim counts as the share `weight` (m,), 0 to 1, of an independent one.
    """

    a: NDArray[np.int64]
    b: NDArray[np.int64]
    place_a: Floats
    place_b: Floats
    sigma_m: Floats
    path_m: Floats
    weight: Floats

    def at_a(self, poses: Floats) -> Floats:
        """(m, 2) m, the places in a in `map`, by the keyframes' `poses` (n, 3)."""
        return _placed(poses[self.a], self.place_a)

    def at_b(self, poses: Floats) -> Floats:
        """(m, 2) m, the places in b, as above."""
        return _placed(poses[self.b], self.place_b)

    def apart(self, poses: Floats) -> Floats:
        """(m, 2) m from the places in a to those in b, as above."""
        return self.at_b(poses) - self.at_a(poses)


@dataclass(frozen=True, slots=True, eq=False)
class Headings:
    """What a building's axes tell of keyframes (m,): they head `turned` (m,) rad from those of their `wing` (m,).

    To `sigma_rad` (m,) each; the direction of the axes of a wing is unknown. All of this may be a mistake, with the
    probability `no_axes`: then they say as much for any headings as for those of the estimate, `estimated` nats.
    """

    keyframe: NDArray[np.int64]
    wing: NDArray[np.int64]
    turned: Floats
    sigma_rad: Floats
    estimated: float = 0.0
    no_axes: float = 0.0

    def gain(self, theta: Floats) -> float:
        """Nats of the keyframes' headings `theta` (n,) over the estimate's, or those for axes that are none."""
        return float(np.logaddexp(self.evidence(theta) - self.estimated, math.log(self.no_axes)))

    def contradict(self, theta: Floats) -> bool:
        """Whether axes that are none explain headings `theta` (n,) better than wrong samples do."""
        return len(self.turned) > 0 and self.evidence(theta) - self.estimated < math.log(self.no_axes)

    def evidence(self, theta: Floats) -> float:
        """Nats of the keyframes' headings `theta` (n,) over headings that are anything; some samples may be wrong."""
        direction = np.exp(1j * (theta[self.keyframe] - self.turned))
        wings, wing = np.unique(self.wing, return_inverse=True)
        mean = np.zeros(len(wings), complex)
        np.add.at(mean, wing, direction)
        off = np.angle(direction * np.conj(mean[wing]))
        ratio = 2 * math.pi * np.exp(-0.5 * (off / self.sigma_rad) ** 2) / (math.sqrt(2 * math.pi) * self.sigma_rad)
        return float(np.log(_WRONG + (1 - _WRONG) * ratio).sum())


def headings_of(axes: Sequence[AxisFactor], poses: Floats, no_axes: float) -> Headings:
    """What these factors of the graph say, which estimates the `poses` (n, 3); see `Headings` for `no_axes`."""
    keyframe, wing = np.array([(f.b, f.wing) for f in axes], np.int64).reshape(-1, 2).T
    turned, sigma_rad = np.array([(f.turned, f.sigma_rad) for f in axes]).reshape(-1, 2).T
    headings = Headings(keyframe, wing, turned, sigma_rad, no_axes=no_axes)
    return replace(headings, estimated=headings.evidence(poses[:, 2]))


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A calibration (4,), its dead reckoning (n, 3), its evidence (nats), and which of the pairs (m,) it explains."""

    values: Floats
    poses: Floats
    evidence: float
    explained: NDArray[np.bool_]


def driven_area(poses: Floats) -> float:
    """m^2 of the two-sigma ellipse of the keyframes' `poses` (n, 3), over which the places of a chance pair may lie."""
    spread = np.cov(poses[:, :2], rowvar=False) + _CORRIDOR_M2 * np.eye(2)
    return float(4 * math.pi * math.sqrt(np.linalg.det(spread)))


def likelihood_ratio(chi2: Floats, variance: Floats, area: float) -> Floats:
    """(m,) likelihood that pairs are true over that they are chance: Gaussian around 0 over uniform in `area` (m^2).

    `chi2` (m,) is the squared distance of their places over `variance` (m,), m^2 along each axis.
    """
    ratio: Floats = area / (2 * math.pi * variance) * np.exp(-0.5 * chi2)
    return ratio


def weigh(poses: Floats, pairs: Pairs, drift: float) -> tuple[float, NDArray[np.bool_]]:
    """The evidence (nats) of `poses` (n, 3) over "all pairs are chance", and which of the pairs (m,) they explain.

    `drift` is the share of the path between two places by which dead reckoning errs at random.
    """
    variance = pairs.sigma_m**2 + (drift * pairs.path_m) ** 2
    chi2 = (pairs.apart(poses) ** 2).sum(axis=1) / variance
    ratio = likelihood_ratio(chi2, variance, driven_area(poses))
    gains = np.log1p(TRUE_SHARES[:, None] * (ratio - 1)) @ pairs.weight
    best = int(np.argmax(gains))
    return float(gains[best]), TRUE_SHARES[best] * ratio > 1 - TRUE_SHARES[best]


def motions_of(wheels: Sequence[WheelFactor], steps: int) -> Floats:
    """(steps, 5) motions between the keyframes: x, y, theta, path (m), time (s); zeros where no wheels relate them."""
    motions = np.zeros((steps, 5))
    for w in wheels:
        motions[w.b - 1] = (*w.motion.pose.array(), w.motion.path_m, w.motion.seconds)
    return motions


def best_hypothesis(
    motions: Floats,
    matched: Floats,
    pairs: Pairs,
    headings: Headings,
    prior: WheelCalibration,
    config: ConsensusConfig,
) -> Hypothesis:
    """The turn bias per metre of most evidence, by the wheels' `motions` (n, 5), `headings` and `pairs`, some false.

    Its evidence is the mean over the prior: a bias that is only the best of many by chance has paid for them. Steps
    whose relative poses are known from scan matches, the rows of `matched` (n, 3) that are not NaN, do not depend on
    the bias.
    """
    offsets = np.linspace(-config.reach_sigmas, config.reach_sigmas, config.steps)
    biases = prior.values[2] + offsets * prior.sigmas[2]
    evidences = _evidence(motions, matched, prior.values, biases, pairs, headings, config.drift)
    prior_weights = -0.5 * offsets**2
    weights = evidences + prior_weights
    values = prior.values.copy()
    values[2] = biases[np.argmax(weights)]
    by_wheels = np.isnan(matched[:, :1])
    poses = chain(np.where(by_wheels, corrected_all(motions, values), matched))
    evidence = float(np.logaddexp.reduce(weights) - np.logaddexp.reduce(prior_weights))
    return Hypothesis(values, poses, evidence, weigh(poses, pairs, config.drift)[1])


def _evidence(
    motions: Floats,
    matched: Floats,
    calibration: Floats,
    biases: Floats,
    pairs: Pairs,
    headings: Headings,
    drift: float,
) -> Floats:
    """(k,) evidence of the dead reckoning with each of the `biases` (k,) in the calibration."""
    variance = pairs.sigma_m**2 + (drift * pairs.path_m) ** 2
    places = pairs.a, pairs.b, pairs.place_a, pairs.place_b
    evidence: Floats = _evidence_of_all(motions, matched, calibration, biases, *places, variance, pairs.weight)
    if len(headings.keyframe):
        turns = corrected_all(motions, calibration)[:, 2]
        known = ~np.isnan(matched[:, 2])
        turned = np.concatenate([[0.0], np.cumsum(np.where(known, matched[:, 2], turns))])
        path_m = np.concatenate([[0.0], np.cumsum(np.where(known, 0.0, motions[:, 3]))])
        for i, bias in enumerate(biases):
            evidence[i] += headings.gain(turned + (bias - calibration[2]) * path_m)
    return evidence


@njit(cache=True)
def _evidence_of_all(
    motions: Floats,
    matched: Floats,
    calibration: Floats,
    biases: Floats,
    a: NDArray[np.int64],
    b: NDArray[np.int64],
    place_a: Floats,
    place_b: Floats,
    variance: Floats,
    weight: Floats,
) -> Floats:
    poses = np.zeros((len(motions) + 1, 3))
    gains = np.zeros((len(biases), len(TRUE_SHARES)))
    for i in range(len(biases)):
        area, far = _reckon(poses, motions, matched, calibration, biases[i]), 0.0
        for k in range(len(a)):
            pose_a, pose_b = poses[a[k]], poses[b[k]]
            ca, sa, cb, sb = math.cos(pose_a[2]), math.sin(pose_a[2]), math.cos(pose_b[2]), math.sin(pose_b[2])
            dx = (
                pose_b[0]
                + cb * place_b[k, 0]
                - sb * place_b[k, 1]
                - pose_a[0]
                - ca * place_a[k, 0]
                + sa * place_a[k, 1]
            )
            dy = (
                pose_b[1]
                + sb * place_b[k, 0]
                + cb * place_b[k, 1]
                - pose_a[1]
                - sa * place_a[k, 0]
                - ca * place_a[k, 1]
            )
            chi2 = (dx * dx + dy * dy) / variance[k]
            if chi2 > FAR_CHI2:
                far += weight[k]
                continue
            ratio = area / (2 * math.pi * variance[k]) * math.exp(-0.5 * chi2)
            for share in range(len(TRUE_SHARES)):
                gains[i, share] += weight[k] * math.log1p(TRUE_SHARES[share] * (ratio - 1))
        gains[i] += far * np.log1p(-TRUE_SHARES)
    best = np.zeros(len(biases))
    for i in range(len(biases)):
        best[i] = gains[i].max()
    return best


@njit(cache=True)
def _reckon(poses: Floats, motions: Floats, matched: Floats, calibration: Floats, bias: float) -> float:
    """Fill `poses` (n + 1, 3) by dead reckoning; returns their `driven_area`."""
    scale, turn_scale, per_s = 1 + calibration[0], calibration[1], calibration[3]
    x, y, heading = 0.0, 0.0, 0.0
    sum_x, sum_y, sum_xx, sum_xy, sum_yy = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(len(motions)):
        step_x, step_y, turn = matched[k, 0], matched[k, 1], matched[k, 2]
        if math.isnan(step_x):
            extra = turn_scale * motions[k, 2] + bias * motions[k, 3] + per_s * motions[k, 4]
            c, s = math.cos(extra / 2) * scale, math.sin(extra / 2) * scale
            step_x, step_y = c * motions[k, 0] - s * motions[k, 1], s * motions[k, 0] + c * motions[k, 1]
            turn = motions[k, 2] + extra
        c, s = math.cos(heading), math.sin(heading)
        x, y, heading = x + c * step_x - s * step_y, y + s * step_x + c * step_y, heading + turn
        poses[k + 1, 0], poses[k + 1, 1], poses[k + 1, 2] = x, y, heading
        sum_x, sum_y, sum_xx, sum_xy, sum_yy = sum_x + x, sum_y + y, sum_xx + x * x, sum_xy + x * y, sum_yy + y * y
    n = len(motions) + 1.0
    mean_x, mean_y = sum_x / n, sum_y / n
    xx = (sum_xx / n - mean_x * mean_x) * n / (n - 1) + _CORRIDOR_M2
    xy = (sum_xy / n - mean_x * mean_y) * n / (n - 1)
    yy = (sum_yy / n - mean_y * mean_y) * n / (n - 1) + _CORRIDOR_M2
    return 4 * math.pi * math.sqrt(xx * yy - xy * xy)


def _placed(poses: Floats, places: Floats) -> Floats:
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + c * places[:, 0] - s * places[:, 1]
    y = poses[:, 1] + s * places[:, 0] + c * places[:, 1]
    return np.stack([x, y], axis=1)
