"""The pose graph: keyframes, the wheels' calibration and the factors between them, smoothed incrementally by iSAM2.

The calibration is a chain of states along the path, because wheels change; one state that every factor shared would
also make each update visit the whole graph.

gtsam's update keeps a bad factor after it has raised an error. So every factor is validated before it enters iSAM2, and
the graph can be rebuilt at any time from the factors that are kept here. A rebuild of a large graph takes several
updates, so that none takes long; until it is done, the estimate stays as it was and loop closures wait.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.axes_chain import AxesChain
from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.calibration_chain import CalibrationChain
from wayfi.backend.graph.factors import (
    AxisFactor,
    BetweenFactor,
    Factor,
    FactorError,
    WheelFactor,
    moves_earlier,
    surprise_m,
    validate,
)
from wayfi.backend.graph.isam import Isam
from wayfi.backend.graph.rebuild import Rebuild, continued
from wayfi.backend.graph.wheel_calibration import WheelCalibration, WheelMotion
from wayfi.backend.pose2 import Floats, Pose2

F = TypeVar("F", bound=Factor)
REBUILD_WORK = 1500  # of a rebuild in one update, counted in factors prepared: 20 to 40 ms


@dataclass(frozen=True, slots=True)
class UpdateSummary:
    """How many factors one update added and removed, how many the graph holds, whether earlier poses may have moved."""

    added: int
    removed: int
    factors: int
    moved: bool = False


class PoseGraph:
    """Keyframes 0, 1, ... in `map` (keyframe 0 is at `origin`), estimated jointly with the wheels' calibration.

    Factors are queued by `add` and take effect with `update`. `add` returns the number that `remove` needs.
    """

    def __init__(self, config: BackendConfig, prior: WheelCalibration, origin: Pose2 = Pose2()) -> None:
        self._config, self._prior, self._origin = config, prior, origin
        self._factors: dict[int, Factor] = {}
        self._next = 0
        self._queued: list[int] = []
        self._queued_poses: dict[int, Pose2] = {}
        self._removed: list[int] = []
        self._substituted: set[int] = set()  # since the rebuild under way began
        self._requested_start: tuple[Floats, Floats] | None = None
        self._rebuilding: Rebuild | None = None
        self.keyframes = self._counted = 0
        self.newest_wing = 0  # the highest number of one whose factors were added
        self._cached_poses: Floats = np.zeros((1, 3))
        self._cache_stale = False
        self._steps: list[Pose2] = []
        self._chain, self._axes = CalibrationChain(config), AxesChain(config)
        self._isam = self._new_isam(prior.values)

    def add_keyframe(self, guess: Pose2) -> int:
        """Add a keyframe with first guess `guess` in `map`; returns its number. Raises FactorError if not finite."""
        if not guess.is_finite():
            raise FactorError(f"the first guess of keyframe {self.keyframes} is not finite: {guess}")
        self._steps.append(self.pose(self.keyframes - 1).between(guess) if self.keyframes else guess)
        self._queued_poses[self.keyframes] = guess
        self._chain.add_keyframe()
        self.keyframes += 1
        return self.keyframes - 1

    def add(self, factor: Factor) -> int:
        """Queue a factor; returns its number. Raises FactorError if the graph could not be solved with it."""
        validate(factor, self.keyframes)
        number, self._next = self._next, self._next + 1
        self._factors[number] = factor
        self._queued.append(number)
        self._chain.add(factor)
        if isinstance(factor, AxisFactor):
            self._axes.add(factor, self._chain.stretch(factor))
            self.newest_wing = max(self.newest_wing, factor.wing)
        return number

    def remove(self, number: int) -> None:
        """Remove factor `number` with the next update. Raises FactorError if there is none."""
        if self._factors.pop(number, None) is None:
            raise FactorError(f"there is no factor {number} in the graph")
        if number in self._queued:
            self._queued.remove(number)
        else:
            self._removed.append(self._isam.indices.pop(number))

    def substitute(self, number: int, factor: Factor) -> None:
        """With the next update, let factor `number` be another between the same keyframes."""
        self._factors[number] = factor
        self._substituted.add(number)
        if number not in self._queued:
            self._removed.append(self._isam.indices.pop(number))
            self._queued.append(number)

    def update(self, work: float = REBUILD_WORK) -> UpdateSummary:
        """Bring the estimate up to date with everything queued.

        iSAM2 takes Gauss-Newton steps, which diverge when a closure is far off: then the graph is rebuilt, with no more
        than `work` in this update.
        """
        added, removed = sum(number >= self._counted for number in self._queued), len(self._removed)
        moves, self._counted = self.pending, self._next
        if self._requested_start is not None:
            self._begin_rebuild(*self._requested_start)
        elif self._rebuilding is None and self._is_surprised():
            self._begin_rebuild(self.calibrations(), self._isam.poses())
        try:
            rebuilt = self._go_on_rebuilding(work)
            self._take_queued()
        except RuntimeError:
            self._begin_rebuild(self._prior.values, self._cached_poses)
            rebuilt = self._go_on_rebuilding(math.inf)
            self._take_queued()
        moved = rebuilt or (moves and self._rebuilding is None) or removed > 0
        self._cache_stale = self._cache_stale or moved
        return UpdateSummary(added, removed, len(self._factors), moved)

    def settle(self) -> None:
        """Update, and then `settle_updates` times more, which relinearises what the last closures moved."""
        self.update(work=math.inf)
        try:
            for _ in range(self._config.settle_updates):
                self._isam.relinearise()
        except RuntimeError:
            self._begin_rebuild(self._prior.values, self._cached_poses)
            self._go_on_rebuilding(math.inf)
        self._cache_stale = True

    @property
    def pending(self) -> bool:
        """Whether the next update may move earlier poses: a loop closure is queued, a removal or a restart."""
        return bool(self._removed) or self.restarts or any(moves_earlier(self._factors[n]) for n in self._queued)

    @property
    def restarts(self) -> bool:
        """Whether a rebuild was asked for or is under way: the present estimate is about to be replaced."""
        return self._requested_start is not None or self._rebuilding is not None

    def restart(self, calibration: Floats, poses: Floats) -> None:
        """With the next update, optimise the whole graph from `poses` (n, 3) and `calibration` (4,) or (k, 4).

        For leaving a wrong local minimum. Keyframes that are added before that update continue from the last pose.
        """
        self._requested_start = (calibration, poses)

    def replace_motions(self, motions: list[WheelMotion]) -> None:
        """With the next update, let the wheel factors, in their order, have other motions; starts from the estimate."""
        numbers = [number for number, factor in self._factors.items() if isinstance(factor, WheelFactor)]
        for number, motion in zip(numbers, motions, strict=True):
            factor = self._factors[number]
            assert isinstance(factor, WheelFactor)
            self._factors[number] = replace(factor, motion=motion)
            self._chain.add(self._factors[number])
        under_way = self._rebuilding.start if self._rebuilding else None
        self._requested_start = self._requested_start or under_way or (self.calibrations(), self.poses())

    def __getstate__(self) -> dict[str, Any]:
        """The state with the estimate in place of iSAM2, which cannot be pickled. No keyframe may be queued."""
        assert not self._queued_poses
        state = {name: value for name, value in vars(self).items() if name not in ("_isam", "_rebuilding")}
        if self._rebuilding and self._requested_start is None:
            state["_requested_start"] = self._rebuilding.start
        return state | {"estimate": (self.calibrations(), self.poses()) if self.keyframes else None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Start iSAM2 again from the estimate; what was queued stays queued."""
        estimate = state.pop("estimate")
        vars(self).update(state)
        self._isam, self._rebuilding = self._new_isam(self._prior.values), None
        if estimate is None:
            return
        removed, restart = self._removed, self._requested_start
        calibration, poses = estimate
        self._begin_rebuild(calibration, poses, left_out=self._queued)
        self._go_on_rebuilding(math.inf)
        self._requested_start = restart or (estimate if removed else None)

    def _begin_rebuild(self, calibration: Floats, poses: Floats, left_out: Iterable[int] = ()) -> None:
        """Begin to optimise all keyframes from `poses` (n, 3) and `calibration`, by the factors not `left_out`.

        `calibration` (4,), or (k, 4) with one a stretch, is held fixed until iSAM2 starts again from the result.
        """
        factors = {number: factor for number, factor in self._factors.items() if number not in left_out}
        start = self._chain.on_every_stretch(calibration, factors.values()), continued(poses, self._steps)
        isam = self._new_isam(start[0][0])
        self._substituted = set()
        self._rebuilding = Rebuild(factors, (self._chain, self._axes), start, isam, self._config.settle_updates)
        self._requested_start = None

    def _go_on_rebuilding(self, work: float) -> bool:
        """Do `work` of a rebuild, if one is under way; adopts its result and returns True if that has completed it."""
        if self._rebuilding is None:
            return False
        self._rebuilding.go_on(work)
        if self._rebuilding.done:
            self._adopt(self._rebuilding.isam)
            self._rebuilding = None
            return True
        return False

    def _adopt(self, isam: Isam) -> None:
        """Go on with the iSAM2 of a rebuild, and queue what has changed since that began."""
        self._isam, changed = isam, self._substituted
        self._cached_poses, self._cache_stale = isam.poses(), False
        self._removed = [isam.indices.pop(n) for n in list(isam.indices) if n not in self._factors or n in changed]
        self._queued = [number for number in self._factors if number not in isam.indices]
        poses = continued(self._cached_poses, self._steps)
        self._queued_poses = {k: Pose2.of(poses[k]) for k in range(isam.keyframes, self.keyframes)}

    def _take_queued(self) -> None:
        """Hand iSAM2 everything queued, but keep loop closures back while a rebuild is under way."""
        held = [n for n in self._queued if moves_earlier(self._factors[n])] if self._rebuilding else []
        factors = {n: self._factors[n] for n in self._queued if n not in held}
        self._isam.update(factors, self._queued_poses, self._removed)
        self._queued, self._queued_poses, self._removed = held, {}, []

    def _is_surprised(self) -> bool:
        """Whether a queued loop closure is too far from the estimate for a Gauss-Newton step."""
        queued = (self._factors[n] for n in self._queued)
        off_m = (surprise_m(f, self.pose(f.a), self.pose(f.b)) for f in queued if moves_earlier(f))
        return max(off_m, default=0.0) > self._config.leap_m

    def pose(self, keyframe: int) -> Pose2:
        """T_map_keyframe as estimated; the first guess before the next update."""
        if keyframe in self._queued_poses:
            return self._queued_poses[keyframe]
        return self._isam.pose(keyframe)

    def poses(self) -> Floats:
        """(n, 3) poses of all keyframes in `map`."""
        if self._cache_stale or len(self._cached_poses) < self.keyframes:
            self._cached_poses, self._cache_stale = self._isam.poses(), False
        return self._cached_poses.copy()

    def calibration(self) -> WheelCalibration:
        """The wheels' calibration on the newest stretch, with its marginal sigmas."""
        return WheelCalibration(self.calibration_values(), self._isam.calibration_sigmas())

    def calibration_values(self) -> Floats:
        """Its (4,) values without the sigmas, which take longer."""
        return self._isam.calibration_values()

    def calibrations(self) -> Floats:
        """(k, 4) the wheels' calibration on each stretch of the path."""
        return self._isam.calibrations()

    def calibrations_along(self) -> Floats:
        """(n, 4) the wheels' calibration on the stretch of each keyframe."""
        return self.calibrations()[np.minimum(self.stretches(), self._isam.stretches - 1)]

    def stretches(self) -> NDArray[np.int64]:
        """(n,) the stretch of the path, from 0, that each keyframe is on."""
        return np.array([self._chain.stretch_of(keyframe) for keyframe in range(self.keyframes)], np.int64)

    def covariance(self, keyframe: int) -> Floats:
        """(3, 3) marginal covariance of a keyframe's pose, in (x, y, theta) of `map`."""
        return self._isam.covariance(keyframe)

    def relative_covariance(self, a: int, b: int) -> Floats:
        """(3, 3) covariance of T_a_b in (x, y, theta) of a, from the joint marginal. About 1 ms at 3,000 keyframes."""
        return self._isam.relative_covariance(a, b)

    def place_covariance(self, a: int, b: int, place_b: Floats) -> Floats:
        """(2, 2) covariance, in a's axes, of the position in keyframe a of `place_b` (2,) m in keyframe b."""
        return self._isam.place_covariance(a, b, place_b)

    def of_kind(self, kind: type[F]) -> list[F]:
        """The factors of a kind in the order in which they were added."""
        return [factor for factor in self._factors.values() if isinstance(factor, kind)]

    def scan_matched(self) -> NDArray[np.bool_]:
        """(n - 1,) whether a scan match relates each keyframe to the next."""
        matched = [f.a for f in self._factors.values() if isinstance(f, BetweenFactor) and f.b == f.a + 1]
        return np.isin(np.arange(self.keyframes - 1), matched)

    def factors(self) -> dict[int, Factor]:
        """Every factor by its number, queued ones included."""
        return dict(self._factors)

    def _new_isam(self, calibration: Floats) -> Isam:
        return Isam(self._config, self._prior, self._chain, self._axes, calibration, self._origin)
