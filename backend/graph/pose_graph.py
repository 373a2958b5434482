"""The pose graph: keyframes, the wheels' calibration and the factors between them, smoothed incrementally by iSAM2.

The calibration is a chain of states along the path, because wheels change; one state that every factor shared would
also make each update visit the whole graph.

gtsam's update keeps a bad factor after it has raised an error. So every factor is validated before it enters iSAM2, and
the graph can be rebuilt at any time from the factors that are kept here.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import gtsam
import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.balance import blocks_ending_at, dissection
from wayfi.backend.graph.batch import of_gtsam, optimised
from wayfi.backend.graph.calibration_chain import CalibrationChain
from wayfi.backend.graph.factors import (
    BetweenFactor,
    Factor,
    FactorError,
    WheelFactor,
    closes_loop,
    distance_m,
    sigma_m,
    validate,
)
from wayfi.backend.graph.gtsam_factors import calibration_key, gtsam_factor, origin_factor, pose_key
from wayfi.backend.graph.isam import new_isam
from wayfi.backend.graph.wheel_calibration import WheelCalibration, WheelMotion
from wayfi.backend.pose2 import Floats, Pose2, adjoint, covariance_in_b

MIN_VARIANCE = 1e-18  # keeps a sigma above zero where rounding makes a marginal variance zero or negative
SURE_SIGMAS = 3  # a closure that is no further off than so many of its own sigmas is no surprise


@dataclass(frozen=True, slots=True)
class UpdateSummary:
    """How many factors one update added and removed, and how many the graph holds after it."""

    added: int
    removed: int
    factors: int


class PoseGraph:
    """Keyframes 0, 1, ... in `map` (keyframe 0 is its origin), estimated jointly with the wheels' calibration.

    Factors are queued by `add` and take effect with `update`. `add` returns the number that `remove` needs.
    """

    def __init__(self, config: BackendConfig, prior: WheelCalibration) -> None:
        self._config = config
        self._prior = prior
        self._factors: dict[int, Factor] = {}
        self._isam_indices: dict[int, int] = {}
        self._next = 0
        self._queued: list[int] = []
        self._queued_poses: dict[int, Pose2] = {}
        self._removed: list[int] = []
        self._requested_start: tuple[Floats, Floats] | None = None
        self.keyframes = 0
        self._cached_poses: Floats = np.zeros((1, 3))
        self._cache_stale = False
        self._first_guesses: list[Pose2] = []
        self._chain = CalibrationChain(config)
        self._stretches = 1
        self._reset_isam(self._prior.values)

    def add_keyframe(self, guess: Pose2) -> int:
        """Add a keyframe with first guess `guess` in `map`; returns its number. Raises FactorError if not finite."""
        if not guess.is_finite():
            raise FactorError(f"the first guess of keyframe {self.keyframes} is not finite: {guess}")
        self._queued_poses[self.keyframes] = guess
        self._first_guesses.append(guess)
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
        return number

    def remove(self, number: int) -> None:
        """Remove factor `number` with the next update. Raises FactorError if there is none."""
        if self._factors.pop(number, None) is None:
            raise FactorError(f"there is no factor {number} in the graph")
        if number in self._queued:
            self._queued.remove(number)
        else:
            self._removed.append(self._isam_indices.pop(number))

    def update(self) -> UpdateSummary:
        """Bring the estimate up to date with everything queued.

        iSAM2 takes Gauss-Newton steps, which diverge when a closure is far off: then the graph is rebuilt.
        """
        summary, moves = UpdateSummary(len(self._queued), len(self._removed), len(self._factors)), self.pending
        if self._requested_start is not None:
            calibration, poses = self._requested_start
            self._rebuild(calibration, self._with_new_keyframes(poses))
            return summary
        if max((self._surprise_m(self._factors[n]) for n in self._queued), default=0.0) > self._config.leap_m:
            self._rebuild(self.calibrations(), self._with_new_keyframes(self._estimated_poses()))
            return summary
        try:
            self._update_isam()
        except RuntimeError:
            self._rebuild(self._prior.values, self._with_new_keyframes(self._cached_poses))
            return summary
        self._cache_stale = self._cache_stale or moves
        return summary

    def settle(self) -> None:
        """Update, and then `settle_updates` times more, which relinearises what the last closures moved."""
        self.update()
        try:
            for _ in range(self._config.settle_updates):
                self._isam.update()
            self._cache_stale = True
        except RuntimeError:
            self._rebuild(self._prior.values, self._cached_poses)

    @property
    def pending(self) -> bool:
        """Whether the next update may move earlier poses: a loop closure is queued, a removal or a restart."""
        changes = bool(self._removed) or self._requested_start is not None
        return changes or any(closes_loop(self._factors[n]) for n in self._queued)

    @property
    def restarts(self) -> bool:
        """Whether `restart` was called since the last update: the present estimate is about to be replaced."""
        return self._requested_start is not None

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
        self._requested_start = (self.calibrations(), self.poses())

    def __getstate__(self) -> dict[str, Any]:
        """The state with the estimate in place of iSAM2, which cannot be pickled. No keyframe may be queued."""
        assert not self._queued_poses
        state = {name: value for name, value in vars(self).items() if name not in ("_isam", "_linearization_point")}
        return state | {"estimate": (self.calibrations(), self.poses()) if self.keyframes else None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Start iSAM2 again from the estimate; what was queued stays queued."""
        estimate = state.pop("estimate")
        vars(self).update(state)
        self._reset_isam(self._prior.values)
        if estimate is None:
            return
        queued, removed, restart = self._queued, self._removed, self._requested_start
        calibration, poses = estimate
        self._rebuild(calibration, poses, [number for number in self._factors if number not in queued])
        self._queued = queued
        self._requested_start = restart or (estimate if removed else None)

    def _rebuild(self, calibration: Floats, poses: Floats, numbers: Iterable[int] | None = None) -> None:
        """Optimise all keyframes from `poses` (n, 3) by Levenberg-Marquardt; iSAM2 starts again from the result.

        `calibration` (4,), or (k, 4) with one a stretch, is held fixed meanwhile. The factors are those of `numbers`,
        or all.
        """
        calibrations = self._chain.on_every_stretch(calibration, self._factors.values())
        numbers = list(self._factors if numbers is None else numbers)
        solved = optimised([self._factors[number] for number in numbers], self._chain, calibrations, poses)
        self._reset_isam(calibrations[0])
        self._queued = list(numbers)
        self._isam_indices, self._removed, self._requested_start = {}, [], None
        self._queued_poses = dict(enumerate(solved))
        self._update_isam(calibrations)
        for _ in range(self._config.settle_updates):
            self._isam.update()
        self._cached_poses, self._cache_stale = self._estimated_poses(), False

    def _update_isam(self, calibrations: Floats | None = None) -> None:
        """Hand everything queued to iSAM2; new stretches begin at `calibrations` (k, 4), or as the newest one is."""
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        last = max((self._chain.stretch(self._factors[n]) for n in self._queued), default=0)
        if last >= self._stretches:
            known = self.calibration_values()[None] if calibrations is None else calibrations
            self._chain.add_states(range(self._stretches, last + 1), known, graph, values)
            self._stretches = last + 1
        walks = graph.size()
        for number in self._queued:
            graph.add(gtsam_factor(self._factors[number], self._chain.stretch(self._factors[number])))
        for keyframe, guess in self._queued_poses.items():
            values.insert(pose_key(keyframe), gtsam.Pose2(guess.x, guess.y, guess.theta))
            if keyframe == 0:
                graph.add(origin_factor())
        result = self._isam.update(graph, values, self._removed)
        self._isam_indices.update(zip(self._queued, list(result.getNewFactorsIndices())[walks:], strict=False))
        grown = bool(self._queued_poses)
        self._queued, self._queued_poses, self._removed = [], {}, []
        if grown and (block := blocks_ending_at(self.keyframes - 1)):
            stretches = sorted({min(self._chain.stretch_of(k), self._stretches - 1) for k in block})
            self._isam.update(gtsam.NonlinearFactorGraph(), gtsam.Values(), dissection(block, stretches))

    def _with_new_keyframes(self, poses: Floats) -> Floats:
        """(n, 3) `poses` of the first keyframes, continued for the later ones by the steps between first guesses."""
        extended = list(poses)
        for k in range(len(extended), self.keyframes):
            step = self._first_guesses[k - 1].between(self._first_guesses[k])
            extended.append((Pose2.of(extended[-1]) @ step).array())
        return np.array(extended)

    def _estimated_poses(self) -> Floats:
        estimate = gtsam.utilities.extractPose2(self._isam.calculateEstimate())
        return np.asarray(estimate, dtype=np.float64).reshape(-1, 3)

    def _surprise_m(self, factor: Factor) -> float:
        """How far (m) a loop closure is from the estimate, less SURE_SIGMAS of it; 0 for a factor that is none."""
        if not closes_loop(factor):
            return 0.0
        return distance_m(factor, self.pose(factor.a), self.pose(factor.b)) - SURE_SIGMAS * sigma_m(factor)

    def pose(self, keyframe: int) -> Pose2:
        """T_map_keyframe as estimated; the first guess before the next update."""
        if keyframe in self._queued_poses:
            return self._queued_poses[keyframe]
        return of_gtsam(self._isam.calculateEstimatePose2(pose_key(keyframe)))

    def poses(self) -> Floats:
        """(n, 3) poses of all keyframes in `map`."""
        if self._cache_stale or len(self._cached_poses) < self.keyframes:
            self._cached_poses, self._cache_stale = self._estimated_poses(), False
        return self._cached_poses.copy()

    def calibration(self) -> WheelCalibration:
        """The wheels' calibration on the newest stretch, with its marginal sigmas."""
        covariance = self._isam.marginalCovariance(calibration_key(self._stretches - 1))
        return WheelCalibration(self.calibration_values(), np.sqrt(np.maximum(np.diag(covariance), MIN_VARIANCE)))

    def calibration_values(self) -> Floats:
        """(4,) the wheels' calibration on the newest stretch without its sigmas, which take longer."""
        return np.asarray(self._isam.calculateEstimateVector(calibration_key(self._stretches - 1)))

    def calibrations(self) -> Floats:
        """(k, 4) the wheels' calibration on each stretch of the path."""
        keys = [calibration_key(stretch) for stretch in range(self._stretches)]
        return np.array([self._isam.calculateEstimateVector(key) for key in keys])

    def covariance(self, keyframe: int) -> Floats:
        """(3, 3) marginal covariance of a keyframe's pose, in (x, y, theta) of `map`."""
        theta = self.pose(keyframe).theta
        return covariance_in_b(np.asarray(self._isam.marginalCovariance(pose_key(keyframe))), -theta)

    def relative_covariance(self, a: int, b: int) -> Floats:
        """(3, 3) covariance of T_a_b in (x, y, theta) of a, from the joint marginal. About 1 ms at 3,000 keyframes."""
        joint = self._isam.jointMarginalCovariance([pose_key(a), pose_key(b)]).fullMatrix()
        T_a_b = self.pose(a).between(self.pose(b))
        J = np.hstack([-adjoint(T_a_b.inverse()), np.eye(3)])
        return covariance_in_b(J @ joint @ J.T, -T_a_b.theta)

    def place_covariance(self, a: int, b: int, place_b: Floats) -> Floats:
        """(2, 2) covariance, in a's axes, of the position in keyframe a of `place_b` (2,) m in keyframe b."""
        turned = self.pose(a).between(self.pose(b)).theta
        x, y = Pose2(0.0, 0.0, turned).transform(place_b[None])[0]
        J = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])
        covariance: Floats = J @ self.relative_covariance(a, b) @ J.T
        return covariance

    def wheels(self) -> list[WheelFactor]:
        """The wheel factors in the order in which they were added."""
        return [factor for factor in self._factors.values() if isinstance(factor, WheelFactor)]

    def scan_matched(self) -> NDArray[np.bool_]:
        """(n - 1,) whether a scan match relates each keyframe to the next."""
        matched = [f.a for f in self._factors.values() if isinstance(f, BetweenFactor) and f.b == f.a + 1]
        return np.isin(np.arange(self.keyframes - 1), matched)

    def factors(self) -> dict[int, Factor]:
        """Every factor by its number, queued ones included."""
        return dict(self._factors)

    def _reset_isam(self, calibration: Floats) -> None:
        self._isam = new_isam(self._config, self._prior, calibration)
        self._stretches = 1
        self._linearization_point = self._isam.getLinearizationPoint()  # else gtsam copies it for every Python factor
