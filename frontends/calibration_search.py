"""Which turn bias explains the closures? A search over all of them, for when the estimate may be in a wrong mode.

Wheels that turn by themselves bend the path into a spiral, and a linearised estimate far from the truth can settle on
the wrong number of turns. Dead reckoning with one bias is a rough trajectory; that which brings most closures together
wins.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats
from wayfi.backend.wheel_calibration import WheelCalibration, dead_reckoning


@dataclass(frozen=True)
class SearchConfig:
    """Bounds of the search."""

    steps: int = option(161, "", "over 4 sigmas each way: 0.001 rad/m apart, 0.1 rad over 100 m")
    drift: float = option(0.03, "1", "of the path between two fingerprints: what dead reckoning errs at random")
    outlier_chi2: float = option(9.0, "", "a closure further off than 3 sigmas counts as wrong, and no more than that")
    min_gain: float = option(15.0, "", "chi2 by which another mode must be better: doubt costs less than a leap")


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """A calibration (4,), its dead reckoning (n, 3), its cost, and which of the closures it explains."""

    values: Floats
    poses: Floats
    cost: float
    explained: NDArray[np.bool_]


def cost_of(poses: Floats, pairs: NDArray[np.int64], paths: Floats, sigma_m: float, config: SearchConfig) -> Floats:
    """(m,) chi2 of closures that say keyframes `pairs` (m, 2) are one place, at `poses` (n, 3)."""
    apart = np.hypot(*(poses[pairs[:, 0], :2] - poses[pairs[:, 1], :2]).T)
    sigma = sigma_m + config.drift * np.abs(paths[pairs[:, 1]] - paths[pairs[:, 0]])
    chi2: Floats = (apart / sigma) ** 2
    return chi2


def best_mode(
    motions: Floats,
    pairs: NDArray[np.int64],
    paths: Floats,
    sigma_m: float,
    prior: WheelCalibration,
    config: SearchConfig,
) -> Mode:
    """The turn bias per metre under which (n, 5) wheel `motions` meet most of the closures `pairs` (m, 2)."""
    best: Mode | None = None
    for offset in np.linspace(-4, 4, config.steps):
        values = prior.values.copy()
        values[2] += offset * prior.sigmas[2]
        poses = dead_reckoning(motions, values)
        chi2 = cost_of(poses, pairs, paths, sigma_m, config)
        cost = float(np.minimum(chi2, config.outlier_chi2).sum() + offset**2)
        if best is None or cost < best.cost:
            best = Mode(values, poses, cost, chi2 < config.outlier_chi2)
    assert best is not None
    return best
