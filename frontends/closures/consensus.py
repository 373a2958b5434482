"""Finds the turn bias of the wheels with which most of WiFi's claims hold, before any is accepted.

Wheels that turn by themselves bend the path into a spiral, and a linearised estimate far from the truth settles on the
wrong number of turns. Dead reckoning with one bias gives a rough trajectory of the whole drive, on which the two places
of a claim either meet or lie apart by chance. The evidence of a bias is the likelihood of that mixture of true and
chance claims, over the likelihood that all claims are chance.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.wheel_calibration import WheelCalibration, chain, corrected_all
from wayfi.backend.pose2 import Floats, between_all
from wayfi.frontends.closures.closure_config import ConsensusConfig

# Shares of true claims at which evidence is computed: within 0.011 nats a claim of the best share from 0.03 to 0.97
TRUE_SHARES = np.array([0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95])
_WRONG = 0.1  # share of headings that may be wrong, as of the samples that are along no axis
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

    To `sigma_rad` (m,) each; the direction of the axes of a wing is unknown.
    """

    keyframe: NDArray[np.int64]
    wing: NDArray[np.int64]
    turned: Floats
    sigma_rad: Floats

    def evidence(self, poses: Floats) -> float:
        """Nats of the keyframes' `poses` (n, 3) over headings that are anything; some of the samples may be wrong."""
        direction = np.exp(1j * (poses[self.keyframe, 2] - self.turned))
        wings, wing = np.unique(self.wing, return_inverse=True)
        mean = np.zeros(len(wings), complex)
        np.add.at(mean, wing, direction)
        off = np.angle(direction * np.conj(mean[wing]))
        ratio = 2 * math.pi * np.exp(-0.5 * (off / self.sigma_rad) ** 2) / (math.sqrt(2 * math.pi) * self.sigma_rad)
        return float(np.log(_WRONG + (1 - _WRONG) * ratio).sum())


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
    the bias. The cost is bounded: for the search, steps are joined to `joined_steps` of the config at most.
    """
    by_wheels = np.isnan(matched[:, :1])
    steps = np.where(by_wheels, corrected_all(motions, prior.values), matched)
    drive = _joined(steps, np.where(by_wheels[:, 0], motions[:, 3], 0.0), pairs, headings, config.joined_steps)
    offsets = np.linspace(-config.reach_sigmas, config.reach_sigmas, config.steps)
    evidences = np.array([drive.evidence(offset * prior.sigmas[2], config.drift) for offset in offsets])
    prior_weights = -0.5 * offsets**2
    weights = evidences + prior_weights
    values = prior.values.copy()
    values[2] += offsets[np.argmax(weights)] * prior.sigmas[2]
    poses = chain(np.where(by_wheels, corrected_all(motions, values), matched))
    evidence = float(np.logaddexp.reduce(weights) - np.logaddexp.reduce(prior_weights))
    return Hypothesis(values, poses, evidence, weigh(poses, pairs, config.drift)[1])


@dataclass(frozen=True, slots=True, eq=False)
class _JoinedDrive:
    """A drive in few steps (g, 5), and what is known of it, expressed in the poses between these steps."""

    motions: Floats
    pairs: Pairs
    headings: Headings

    def evidence(self, bias: float, drift: float) -> float:
        """Nats for one more rad/m of turn `bias`."""
        poses = chain(corrected_all(self.motions, np.array([0.0, 0.0, bias, 0.0])))
        return weigh(poses, self.pairs, drift)[0] + self.headings.evidence(poses)


def _joined(steps: Floats, path_m: Floats, pairs: Pairs, headings: Headings, most: int) -> _JoinedDrive:
    """The drive of `steps` (n, 3), on which the wheels drove `path_m` (n,), in `most` steps or fewer.

    Within a step of the joined drive, which is a few metres long, the places stay where dead reckoning puts them.
    """
    every = math.ceil(len(steps) / most)
    poses = chain(steps)
    ends = np.append(np.arange(0, len(steps), every), len(steps))
    rows = np.zeros((len(ends) - 1, 5))
    rows[:, :3] = between_all(poses[ends[:-1]], poses[ends[1:]])
    rows[:, 3] = np.add.reduceat(path_m, ends[:-1])

    def within(keyframes: NDArray[np.int64]) -> Floats:
        return between_all(poses[keyframes - keyframes % every], poses[keyframes])

    joined_pairs = replace(
        pairs,
        a=pairs.a // every,
        b=pairs.b // every,
        place_a=_placed(within(pairs.a), pairs.place_a),
        place_b=_placed(within(pairs.b), pairs.place_b),
    )
    turned = headings.turned - within(headings.keyframe)[:, 2]
    return _JoinedDrive(rows, joined_pairs, replace(headings, keyframe=headings.keyframe // every, turned=turned))


def _placed(poses: Floats, places: Floats) -> Floats:
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + c * places[:, 0] - s * places[:, 1]
    y = poses[:, 1] + s * places[:, 0] + c * places[:, 1]
    return np.stack([x, y], axis=1)
