"""The pose graph: keyframes, the wheels' calibration and the factors between them, smoothed incrementally by iSAM2.

Nothing enters iSAM2 that could poison it: gtsam's update keeps a bad factor after it has raised, so every factor is
validated first, and the graph can be rebuilt at any time from what is kept here.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import gtsam
import numpy as np

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import Factor, FactorError, NearFactor, WheelFactor, closes_loop, validate
from wayfi.backend.graph.gtsam_factors import (
    CALIBRATION,
    calibrated_factor,
    gtsam_factor,
    in_b,
    origin_factor,
    pose_key,
)
from wayfi.backend.graph.isam import fresh_isam
from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.pose2 import Floats, Pose2, adjoint


@dataclass(frozen=True, slots=True)
class UpdateSummary:
    """What one update did: factors in, out and in all."""

    added: int
    removed: int
    factors: int


class PoseGraph:
    """Keyframes 0, 1, ... in `map` (keyframe 0 is its origin), estimated jointly with the wheels' calibration.

    Factors are queued by `add` and take effect with `update`; `add` returns the number by which `remove` takes it out.
    """

    def __init__(self, config: BackendConfig, prior: WheelCalibration) -> None:
        self._config = config
        self._prior = prior
        self._factors: dict[int, Factor] = {}
        self._slots: dict[int, int] = {}
        self._next = 0
        self._queued: list[int] = []
        self._queued_poses: dict[int, Pose2] = {}
        self._removed: list[int] = []
        self._restart: tuple[Floats, Floats] | None = None
        self.keyframes = 0
        self._settled: Floats = np.zeros((1, 3))
        self._stale = False
        self._guesses: list[Pose2] = []
        self._begin_isam(self._prior.values)

    def add_keyframe(self, guess: Pose2) -> int:
        """A new keyframe near `guess` in `map`; returns its number. Raises FactorError if the guess is not finite."""
        if not guess.is_finite():
            raise FactorError(f"the first guess of keyframe {self.keyframes} is not finite: {guess}")
        self._queued_poses[self.keyframes] = guess
        self._guesses.append(guess)
        self.keyframes += 1
        return self.keyframes - 1

    def add(self, factor: Factor) -> int:
        """Queue a factor; returns its number. Raises FactorError if it could not be estimated with."""
        validate(factor, self.keyframes)
        number, self._next = self._next, self._next + 1
        self._factors[number] = factor
        self._queued.append(number)
        return number

    def remove(self, number: int) -> None:
        """Take factor `number` out again, with the next update."""
        if self._factors.pop(number, None) is None:
            raise FactorError(f"there is no factor {number} in the graph")
        if number in self._queued:
            self._queued.remove(number)
        else:
            self._removed.append(self._slots.pop(number))

    def update(self) -> UpdateSummary:
        """Bring the estimate up to date with everything queued.

        iSAM2 takes Gauss-Newton steps, which leap when a closure is far off: then everything is optimised anew.
        """
        summary = UpdateSummary(len(self._queued), len(self._removed), len(self._factors))
        moves = self.pending
        if self._restart is not None:
            calibration, poses = self._restart
            self._rebuild(calibration, self._extended(poses))
            return summary
        if max((self._disagreement(self._factors[n]) for n in self._queued), default=0.0) > self._config.leap_m:
            self._rebuild(self.calibration_values(), self._extended(self._whole_estimate()))
            return summary
        try:
            self._step()
        except RuntimeError:
            self._rebuild(self._prior.values, self._extended(self._settled))
            return summary
        self._stale = self._stale or moves
        return summary

    def settle(self) -> None:
        """Update until what the last closures moved has found its place."""
        self.update()
        try:
            for _ in range(self._config.settle_updates):
                self._isam.update()
            self._stale = True
        except RuntimeError:
            self._rebuild(self._prior.values, self._settled)

    @property
    def pending(self) -> bool:
        """Whether the next update may move earlier poses: a loop closure is queued, a removal or a restart."""
        changes = bool(self._removed) or self._restart is not None
        return changes or any(closes_loop(self._factors[n]) for n in self._queued)

    @property
    def restarts(self) -> bool:
        """Whether the next update will start again from elsewhere: the estimate of now is given up."""
        return self._restart is not None

    def restart(self, calibration: Floats, poses: Floats) -> None:
        """With the next update, optimise everything anew from `poses` (n, 3) and `calibration` (4,).

        For leaving a wrong basin. Keyframes that come before that update follow on from the last of the poses.
        """
        self._restart = (calibration, poses)

    def __getstate__(self) -> dict[str, Any]:
        """All but iSAM2, which cannot be pickled: in its place the estimate. Between two updates only."""
        assert not self._queued_poses
        state = {name: value for name, value in vars(self).items() if name not in ("_isam", "_held")}
        return state | {"estimate": (self.calibration_values(), self.poses()) if self.keyframes else None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """iSAM2 starts again from the estimate; what was about to change it waits for the next update as before."""
        estimate = state.pop("estimate")
        vars(self).update(state)
        self._begin_isam(self._prior.values)
        if estimate is None:
            return
        queued, removed, restart = self._queued, self._removed, self._restart
        calibration, poses = estimate
        self._rebuild(calibration, poses, [number for number in self._factors if number not in queued])
        self._queued = queued
        self._restart = restart or (estimate if removed else None)

    def _rebuild(self, calibration: Floats, poses: Floats, numbers: Iterable[int] | None = None) -> None:
        """Levenberg-Marquardt, which does not leap, moves the keyframes; iSAM2 starts again from there.

        It takes the factors of `numbers`, or all.
        """
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        graph.addPriorVector(CALIBRATION, calibration, gtsam.noiseModel.Isotropic.Sigma(4, 1e-6))
        values.insert(CALIBRATION, calibration)
        graph.add(origin_factor())
        for keyframe, (x, y, theta) in enumerate(poses):
            values.insert(pose_key(keyframe), gtsam.Pose2(x, y, theta))
        numbers = list(self._factors if numbers is None else numbers)
        for number in numbers:
            graph.add(calibrated_factor(self._factors[number], calibration))
        solved = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
        self._begin_isam(calibration)
        self._queued = list(numbers)
        self._slots, self._removed, self._restart = {}, [], None
        self._queued_poses = {k: _pose2(solved.atPose2(pose_key(k))) for k in range(len(poses))}
        self._step()
        for _ in range(self._config.settle_updates):
            self._isam.update()
        self._settled, self._stale = self._whole_estimate(), False

    def _step(self) -> None:
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        for number in self._queued:
            graph.add(gtsam_factor(self._factors[number]))
        for keyframe, guess in self._queued_poses.items():
            values.insert(pose_key(keyframe), gtsam.Pose2(guess.x, guess.y, guess.theta))
            if keyframe == 0:
                graph.add(origin_factor())
        result = self._isam.update(graph, values, self._removed)
        self._slots.update(zip(self._queued, result.getNewFactorsIndices(), strict=False))
        self._queued, self._queued_poses, self._removed = [], {}, []

    def _extended(self, poses: Floats) -> Floats:
        """(n, 3) `poses` of the first keyframes, and from there on the steps between the first guesses."""
        extended = list(poses)
        for k in range(len(extended), self.keyframes):
            step = self._guesses[k - 1].between(self._guesses[k])
            extended.append((Pose2.of(extended[-1]) @ step).array())
        return np.array(extended)

    def _whole_estimate(self) -> Floats:
        estimate = gtsam.utilities.extractPose2(self._isam.calculateEstimate())
        return np.asarray(estimate, dtype=np.float64).reshape(-1, 3)

    def _disagreement(self, factor: Factor) -> float:
        """How far (m) a closure is from the estimate, beyond three sigmas of it; 0 for a factor that closes none."""
        if not closes_loop(factor) or isinstance(factor, WheelFactor):
            return 0.0
        T_map_a, T_map_b = self.pose(factor.a), self.pose(factor.b)
        if isinstance(factor, NearFactor):
            (ax, ay), (bx, by) = T_map_a.transform(factor.place_a[None])[0], T_map_b.transform(factor.place_b[None])[0]
            return math.hypot(bx - ax, by - ay) - 3 * factor.sigma_m
        apart = T_map_a.between(T_map_b).distance(factor.T_a_b)
        return apart - 3 * math.sqrt(float(factor.covariance[0, 0] + factor.covariance[1, 1]) / 2)

    def pose(self, keyframe: int) -> Pose2:
        """T_map_keyframe as estimated now."""
        if keyframe in self._queued_poses:
            return self._queued_poses[keyframe]
        return _pose2(self._isam.calculateEstimatePose2(pose_key(keyframe)))

    def poses(self) -> Floats:
        """(n, 3) poses of all keyframes in `map`, as estimated now."""
        if self._stale or len(self._settled) < self.keyframes:
            self._settled, self._stale = self._whole_estimate(), False
        return self._settled.copy()

    def calibration(self) -> WheelCalibration:
        """The wheels' calibration with its marginal sigmas."""
        values = np.asarray(self._isam.calculateEstimateVector(CALIBRATION))
        covariance = self._isam.marginalCovariance(CALIBRATION)
        return WheelCalibration(values, np.sqrt(np.maximum(np.diag(covariance), 1e-18)))

    def calibration_values(self) -> Floats:
        """(4,) the wheels' calibration alone: cheaper than with its sigmas."""
        return np.asarray(self._isam.calculateEstimateVector(CALIBRATION))

    def covariance(self, keyframe: int) -> Floats:
        """(3, 3) marginal covariance of a keyframe's pose, in (x, y, theta) of `map`."""
        theta = self.pose(keyframe).theta
        return in_b(np.asarray(self._isam.marginalCovariance(pose_key(keyframe))), -theta)

    def relative_covariance(self, a: int, b: int) -> Floats:
        """(3, 3) covariance of T_a_b in (x, y, theta) of a, from the joint marginal. About 1 ms at 3,000 keyframes."""
        joint = self._isam.jointMarginalCovariance([pose_key(a), pose_key(b)]).fullMatrix()
        T_a_b = self.pose(a).between(self.pose(b))
        J = np.hstack([-adjoint(T_a_b.inverse()), np.eye(3)])
        return in_b(J @ joint @ J.T, -T_a_b.theta)

    def place_covariance(self, a: int, b: int, place_b: Floats) -> Floats:
        """(2, 2) covariance, in axes of a, of where `place_b` (2,) m of keyframe b lies in keyframe a."""
        turned = self.pose(a).between(self.pose(b)).theta
        x, y = Pose2(0.0, 0.0, turned).transform(place_b[None])[0]
        J = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])
        covariance: Floats = J @ self.relative_covariance(a, b) @ J.T
        return covariance

    def wheels(self) -> list[WheelFactor]:
        """The wheel factors, in the order they came."""
        return [factor for factor in self._factors.values() if isinstance(factor, WheelFactor)]

    def factors(self) -> dict[int, Factor]:
        """Every factor by its number, queued ones included."""
        return dict(self._factors)

    def _begin_isam(self, calibration: Floats) -> None:
        self._isam = fresh_isam(self._config, self._prior, calibration)
        self._held = self._isam.getLinearizationPoint()  # while Python holds it, gtsam's calls into it copy nothing


def _pose2(pose: gtsam.Pose2) -> Pose2:
    return Pose2(pose.x(), pose.y(), pose.theta())
