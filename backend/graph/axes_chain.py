"""The directions of a building's axes along the path: a state for each stretch of a wing, joined by a random walk."""

from collections.abc import Callable, Iterable

import gtsam
import numpy as np

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import AxisFactor, Factor
from wayfi.backend.graph.gtsam_factors import axes_key, axes_prior, axes_walk
from wayfi.backend.pose2 import Pose2, wrap

_ANY_RAD = 10.0  # sigma of the direction of a new wing: as good as unknown


class AxesChain:
    """Numbers the states in the order in which their first factors come.

    One state for a whole wing would be shared by all of its keyframes, and each update would visit all of them.
    """

    def __init__(self, config: BackendConfig) -> None:
        self._config = config
        self._states: dict[tuple[int, int], int] = {}
        self._wings: list[int] = []
        self._present, self._newest = 0, 0.0

    def add(self, factor: AxisFactor, stretch: int) -> None:
        """Take note of a new factor, whose keyframe is on `stretch` of the wheels' calibration."""
        block = (factor.wing, stretch // self._config.axes_stretches)
        if block not in self._states:
            self._states[block] = len(self._wings)
            self._wings.append(factor.wing)

    def reset(self) -> None:
        """Forget which states a solver has: a new one begins."""
        self._present, self._newest = 0, 0.0

    def state(self, factor: Factor, stretch: int) -> int:
        """The number of the state of a factor; 0 for one that has none."""
        if not isinstance(factor, AxisFactor):
            return 0
        return self._states[factor.wing, stretch // self._config.axes_stretches]

    def add_states(
        self,
        factors: Iterable[tuple[Factor, int]],
        pose: Callable[[int], Pose2],
        graph: gtsam.NonlinearFactorGraph,
        values: gtsam.Values,
    ) -> None:
        """Add the states that `factors`, each with its stretch, need anew, and the walk to each.

        A new wing's direction begins as the `pose` of a keyframe says.
        """
        for factor, stretch in factors:
            while isinstance(factor, AxisFactor) and self._present <= self.state(factor, stretch):
                turn = wrap(pose(factor.b).theta - factor.turned - self._newest)
                self._newest += turn  # of directions that are whole turns apart, the one near the state before
                self._add_state(self._present, self._newest, graph, values)
                self._present += 1

    def _add_state(self, state: int, guess: float, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
        values.insert(axes_key(state), np.array([guess]))
        continues = state > 0 and self._wings[state - 1] == self._wings[state]
        graph.add(axes_walk(state, self._config.walk_axes_rad) if continues else axes_prior(state, guess, _ANY_RAD))
