"""The wheels' calibration along the path: one state for each stretch of it, joined by a random walk."""

import math
from collections.abc import Iterable

import gtsam
import numpy as np

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import BetweenFactor, Factor, WheelFactor
from wayfi.backend.graph.gtsam_factors import calibration_key, walk_factor
from wayfi.backend.graph.walk_rate import WalkRate
from wayfi.backend.pose2 import Floats


class CalibrationChain:
    """Knows the stretch of each keyframe, by the path that the wheel factors measure."""

    def __init__(self, config: BackendConfig) -> None:
        self._config = config
        self._path_m: list[float] = []
        self._matched: set[int] = set()
        self._newest: WheelFactor | None = None
        self._rate = WalkRate(self._rates()[1:])

    def add_keyframe(self) -> None:
        """Add the next keyframe, at the place of the one before until a wheel factor says otherwise."""
        self._path_m.append(self._path_m[-1] if self._path_m else 0.0)

    def add(self, factor: Factor) -> None:
        """Take note of a new factor: how far its later keyframe is along the path, or how far the robot really turned.

        A step's wheel factor comes before its scan match.
        """
        if isinstance(factor, WheelFactor):
            self._path_m[factor.b] = self._path_m[factor.a] + factor.motion.path_m
            self._newest = factor
        elif isinstance(factor, BetweenFactor) and factor.b == factor.a + 1:
            self._matched.add(self.stretch(factor))
            self._learn(factor)

    def stretch(self, factor: Factor) -> int:
        """The stretch that a factor's later keyframe is on."""
        return self.stretch_of(factor.b)

    def stretch_of(self, keyframe: int) -> int:
        """The stretch that a keyframe is on."""
        return int(self._path_m[keyframe] / self._config.stretch_m)

    def on_every_stretch(self, calibration: Floats, factors: Iterable[Factor]) -> Floats:
        """(k, 4) for all stretches of `factors`, from one calibration (4,) or those of the first stretches (j, 4)."""
        known = np.atleast_2d(calibration)
        stretches = max((self.stretch(factor) for factor in factors), default=0) + 1
        return known[np.minimum(np.arange(stretches), len(known) - 1)]

    def add_states(
        self, stretches: Iterable[int], calibrations: Floats, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values
    ) -> None:
        """Add the states of `stretches` and the walk to each; they begin at `calibrations` (k, 4), or its last."""
        for stretch in stretches:
            values.insert(calibration_key(stretch), calibrations[min(stretch, len(calibrations) - 1)])
            graph.add(walk_factor(stretch, self._walk_sigmas(stretch)))

    def _learn(self, match: BetweenFactor) -> None:
        """Compare the scan match of the newest step with its wheels, once."""
        wheels, self._newest = self._newest, None
        if wheels is None or wheels.b != match.b or wheels.motion.discontinuities:
            return
        variance = float(wheels.covariance[2, 2] + match.covariance[2, 2])
        self._rate.add(wheels.motion, match.T_a_b.theta, variance)

    def _walk_sigmas(self, stretch: int) -> Floats:
        """(4,) of the random walk's step to a stretch: as learnt; no slower than configured, for wheels also slip.

        Until it is known, it is small where no scan match shows the wheels' error.
        """
        taught = self._rate.path_m >= self._config.taught_m
        turns = max(1.0, self._rate.factor) if taught else 1.0
        observed = 1.0 if taught or stretch in self._matched else self._config.unobserved_walk
        return observed * math.sqrt(self._config.stretch_m) * self._rates() * [1.0, turns, turns, turns]

    def _rates(self) -> Floats:
        """(4,) as configured, for each square root of a metre."""
        turn_bias = self._config.walk_turn_bias_rad_per_m, self._config.walk_turn_bias_rad_per_s
        return np.array([self._config.walk_distance_scale, self._config.walk_turn_scale, *turn_bias])
