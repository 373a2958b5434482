"""The directions of a building's axes along the path: a state for each stretch of a wing, joined by a random walk."""

from collections.abc import Callable, Iterable

import gtsam
import numpy as np

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import AxisFactor, Factor, WallFactor
from wayfi.backend.graph.gtsam_factors import axes_key, axes_prior, axes_walk
from wayfi.backend.pose2 import wrap

_ANY_RAD = 10.0  # sigma of the direction of a new wing: as good as unknown


class AxesChain:
    """Numbers the states in the order in which their first factors come.

    One state for a whole wing would be shared by all of its keyframes, and each update would visit all of them.
    """

    def __init__(self, config: BackendConfig) -> None:
        self._config = config
        self._numbers: dict[tuple[int, int], int] = {}
        self._of_keyframe: dict[int, dict[int, int]] = {}  # by wing
        self._wings: list[int] = []
        self._walks_rad: list[float] = []

    @property
    def states(self) -> int:
        """How many there are."""
        return len(self._wings)

    def add(self, factor: AxisFactor, stretch: int) -> None:
        """Take note of a new factor, whose keyframe is on `stretch` of the wheels' calibration."""
        block = (factor.wing, stretch // self._config.axes_stretches)
        if block not in self._numbers:
            self._numbers[block] = len(self._wings)
            self._wings.append(factor.wing)
            of_walls = isinstance(factor, WallFactor)
            self._walks_rad.append(self._config.walk_walls_rad if of_walls else self._config.walk_axes_rad)
        self._of_keyframe.setdefault(factor.b, {})[factor.wing] = self._numbers[block]

    def state(self, factor: Factor) -> int:
        """The number of the state of a factor; 0 for one that has none."""
        return self._of_keyframe[factor.b][factor.wing] if isinstance(factor, AxisFactor) else 0

    def states_of(self, keyframes: Iterable[int]) -> set[int]:
        """The states of the factors that these keyframes have."""
        return {state for k in keyframes for state in self._of_keyframe.get(k, {}).values()}

    def before(self, state: int) -> int | None:
        """The state before it of the same wing, to which the robot may have come back; None for its first."""
        earlier = range(state - 1, -1, -1)
        return next((number for number in earlier if self._wings[number] == self._wings[state]), None)

    def begins(self, state: int, direction: float) -> gtsam.NonlinearFactor:
        """The walk from the state before, or the prior, around `direction` (rad), of the first of a wing."""
        before = self.before(state)
        if before is None:
            return axes_prior(state, direction, _ANY_RAD)
        return axes_walk(before, state, self._walks_rad[state])


class AxesStates:
    """The states that one solver has of the chain."""

    def __init__(self, chain: AxesChain) -> None:
        self._chain = chain
        self._directions: list[float] = []

    def of(self, keyframes: Iterable[int]) -> list[int]:
        """The states that the solver has of those of these keyframes."""
        return sorted(state for state in self._chain.states_of(keyframes) if state < len(self._directions))

    def add(
        self,
        factors: Iterable[Factor],
        heading: Callable[[int], float],
        graph: gtsam.NonlinearFactorGraph,
        values: gtsam.Values,
    ) -> None:
        """Add the states that `factors` need anew, each near what the `heading` (rad) of a keyframe says."""
        for factor in factors:
            while isinstance(factor, AxisFactor) and len(self._directions) <= self._chain.state(factor):
                state = len(self._directions)
                near = self._near(state)
                # of directions that are whole turns apart, the one near the state before
                direction = near + wrap(heading(factor.b) - factor.turned - near)
                self._directions.append(direction)
                values.insert(axes_key(state), np.array([direction]))
                graph.add(self._chain.begins(state, direction))

    def _near(self, state: int) -> float:
        """The direction of the state before it, of the same wing if there is one."""
        before = self._chain.before(state)
        if before is None:
            return self._directions[-1] if self._directions else 0.0
        return self._directions[before]
