"""Which turn bias makes most of WiFi's pairs of places meet? Evidence for every one, before any pair is believed.

Wheels that turn by themselves bend the path into a spiral, and a linearised estimate far from the truth settles on the
wrong number of turns. Dead reckoning with one bias is a rough trajectory of the whole drive; each pair of places either
says where it bends, or is chance. A mixture of the two weighs every bias against "all of it is chance".
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.wheel_calibration import WheelCalibration, dead_reckoning
from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats

TRUE_SHARES = np.array([0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95])
_PLAY_M2 = 1.0  # variance added to that of the path: a straight corridor has an area too


@dataclass(frozen=True)
class ConsensusConfig:
    """What it takes to believe that WiFi's pairs of places agree."""

    steps: int = option(241, "", "over 4 sigmas each way: 0.001 rad/m apart, 0.1 rad over 100 m")
    drift: float = option(0.01, "1", "of the path between two places: what the wheels of real robots err at random")
    min_gain: float = option(4.0, "", "nats by which another bias must be better, while more is to come: 1000 to 1")
    min_gain_at_end: float = option(1.0, "", "the same at the end, when the better guess is all there can be")
    min_posterior: float = option(0.9, "", "of a pair to be true, given the estimate, before it enters the graph")
    max_apart_m: float = option(3.0, "m", "an accepted pair whose places end further apart is taken back")
    max_apart_sigmas: float = option(3.5, "", "as above, by what it claimed: 1 in 500 true pairs is beyond")
    window: int = option(500, "pairs", "the newest: bounds the cost; some hours of a robot that keeps coming back")


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Pairs of places: `a`, `b` (m,) keyframes, `place_a`, `place_b` (m, 2) m in their frames, and what they claim.

    They are one place to `sigma_m` (m,) along each axis; `path_m` (m,) lies between them. A pair counts as `weight`
    (m,) of an independent one.
    """

    a: NDArray[np.int64]
    b: NDArray[np.int64]
    place_a: Floats
    place_b: Floats
    sigma_m: Floats
    path_m: Floats
    weight: Floats

    def at_a(self, poses: Floats) -> Floats:
        """(m, 2) m the places in a, in `map`, the keyframes standing at `poses` (n, 3)."""
        return _placed(poses[self.a], self.place_a)

    def at_b(self, poses: Floats) -> Floats:
        """(m, 2) m the places in b, as above."""
        return _placed(poses[self.b], self.place_b)

    def apart(self, poses: Floats) -> Floats:
        """(m, 2) m from the places in a to those in b, as above."""
        return self.at_b(poses) - self.at_a(poses)


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A calibration (4,), its dead reckoning (n, 3), its evidence (nats), and which of the pairs (m,) it explains."""

    values: Floats
    poses: Floats
    evidence: float
    explained: NDArray[np.bool_]


def driven_area(poses: Floats) -> float:
    """m2 of the ellipse over which the keyframes (n, 3) are spread: where a pair that is chance may lie."""
    spread = np.cov(poses[:, :2], rowvar=False) + _PLAY_M2 * np.eye(2)
    return float(4 * math.pi * math.sqrt(np.linalg.det(spread)))


def likelihood_ratio(chi2: Floats, variance: Floats, area: float) -> Floats:
    """How much likelier pairs (m,) that lie `chi2` apart, of `variance` (m,) m2 along each axis, are true than chance.

    What is true is spread around no distance, what is chance over the `area` (m2).
    """
    ratio: Floats = area / (2 * math.pi * variance) * np.exp(-0.5 * chi2)
    return ratio


def weigh(poses: Floats, pairs: Pairs, drift: float) -> tuple[float, NDArray[np.bool_]]:
    """The evidence (nats) of keyframes' `poses` (n, 3) over "all is chance", and which of the pairs they explain."""
    variance = pairs.sigma_m**2 + (drift * pairs.path_m) ** 2
    chi2 = (pairs.apart(poses) ** 2).sum(axis=1) / variance
    ratio = likelihood_ratio(chi2, variance, driven_area(poses))
    gains = np.log1p(TRUE_SHARES[:, None] * (ratio - 1)) @ pairs.weight
    best = int(np.argmax(gains))
    return float(gains[best]), TRUE_SHARES[best] * ratio > 1 - TRUE_SHARES[best]


def best_hypothesis(motions: Floats, pairs: Pairs, prior: WheelCalibration, config: ConsensusConfig) -> Hypothesis:
    """The turn bias per metre of most evidence, given the wheels' `motions` (n, 5) and `pairs`; sound ones or not."""
    best: Hypothesis | None = None
    for offset in np.linspace(-4, 4, config.steps):
        values = prior.values.copy()
        values[2] += offset * prior.sigmas[2]
        poses = dead_reckoning(motions, values)
        evidence, explained = weigh(poses, pairs, config.drift)
        evidence -= 0.5 * offset**2
        if best is None or evidence > best.evidence:
            best = Hypothesis(values, poses, evidence, explained)
    assert best is not None
    return best


def _placed(poses: Floats, places: Floats) -> Floats:
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + c * places[:, 0] - s * places[:, 1]
    y = poses[:, 1] + s * places[:, 0] + c * places[:, 1]
    return np.stack([x, y], axis=1)
