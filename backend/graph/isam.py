"""iSAM2 as the pose graph uses it."""

from collections.abc import Iterable, Mapping, Sequence

import gtsam
import numpy as np

from wayfi.backend.graph.axes_chain import AxesChain, AxesStates
from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.balance import BLOCK, blocks_ending_at, dissection
from wayfi.backend.graph.batch import of_gtsam
from wayfi.backend.graph.calibration_chain import CalibrationChain
from wayfi.backend.graph.factors import Factor
from wayfi.backend.graph.gtsam_factors import calibration_key, gtsam_factor, origin_factor, pose_key
from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.pose2 import Floats, Pose2, adjoint, covariance_in_b

MIN_VARIANCE = 1e-18  # keeps a sigma above zero where rounding makes a marginal variance zero or negative
REORDERED_SHARE = 0.65  # gtsam's own: where an update touches more of the states, it orders all of them anew


class Isam:
    """iSAM2 over the keyframes and the chains of calibrations and axes; at first, only a calibration with its prior.

    The first keyframe is at `origin` in `map`.

    `tree` is gtsam's own object. It holds `keyframes` poses, `stretches` calibrations, and the factors of `indices`,
    which are its own numbers by those of the graph.
    """

    def __init__(
        self,
        config: BackendConfig,
        prior: WheelCalibration,
        chain: CalibrationChain,
        axes: AxesChain,
        calibration: Floats,
        origin: Pose2,
    ) -> None:
        self.origin = origin
        self._chain, self._axes, self._axes_states = chain, axes, AxesStates(axes)
        self.indices: dict[int, int] = {}
        self.stretches, self.keyframes = 1, 0
        self._reordered = False
        self.tree = gtsam.ISAM2(_params(config))
        self._linearization_point = self.tree.getLinearizationPoint()  # else gtsam copies it for every Python factor
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        graph.addPriorVector(calibration_key(0), prior.values, gtsam.noiseModel.Diagonal.Sigmas(prior.sigmas))
        values.insert(calibration_key(0), calibration)
        self.tree.update(graph, values)

    def update(
        self,
        factors: Mapping[int, Factor],
        poses: Mapping[int, Pose2],
        removed: Iterable[int] = (),
    ) -> None:
        """Add factors and the next keyframes at first guesses, and remove factors by gtsam's numbers.

        Raises RuntimeError where the equations cannot be solved.
        """
        params, reordered = gtsam.ISAM2UpdateParams(), self._reordered
        params.removeFactorIndices = list(removed)
        self._update(factors, poses, self.calibration_values()[None], params)
        if reordered:
            self._eliminate_again(range(self.keyframes), gtsam.KeyList())
        elif poses:
            self._eliminate_again(blocks_ending_at(self.keyframes - 1), gtsam.KeyList())

    def start(
        self, factors: Mapping[int, Factor], poses: Mapping[int, Pose2], calibrations: Floats, held: gtsam.KeyList
    ) -> None:
        """Add a part of a solved graph, new stretches at `calibrations` (k, 4), without relinearising the keys `held`.

        As long as later closures are missing, they would move away from the solution.
        """
        params = gtsam.ISAM2UpdateParams()
        params.noRelinKeys = held
        self._update(factors, poses, calibrations, params)
        self._eliminate_again(blocks_ending_at(self.keyframes - 1), held)

    def _update(
        self,
        factors: Mapping[int, Factor],
        poses: Mapping[int, Pose2],
        calibrations: Floats,
        params: gtsam.ISAM2UpdateParams,
    ) -> None:
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        last = max((self._chain.stretch(factor) for factor in factors.values()), default=0)
        if last >= self.stretches:
            self._chain.add_states(range(self.stretches, last + 1), calibrations, graph, values)
            self.stretches = last + 1
        self._axes_states.add(
            factors.values(), lambda keyframe: (poses.get(keyframe) or self.pose(keyframe)).theta, graph, values
        )
        walks = graph.size()
        for factor in factors.values():
            graph.add(gtsam_factor(factor, self._chain.stretch(factor), self._axes.state(factor)))
        for keyframe, guess in poses.items():
            values.insert(pose_key(keyframe), gtsam.Pose2(guess.x, guess.y, guess.theta))
            if keyframe == 0:
                graph.add(origin_factor(self.origin))
        result = self.tree.update(graph, values, params)
        self.indices.update(zip(factors, list(result.getNewFactorsIndices())[walks:], strict=False))
        self.keyframes += len(poses)
        self._note_order(result)

    def relinearise(self) -> int:
        """Relinearise what has moved since; returns how many states had."""
        result = self.tree.update()
        self._note_order(result)
        return int(result.getVariablesRelinearized())

    def pose(self, keyframe: int) -> Pose2:
        """The estimated pose of a keyframe."""
        return of_gtsam(self.tree.calculateEstimatePose2(pose_key(keyframe)))

    def poses(self) -> Floats:
        """(n, 3) estimated poses of all keyframes."""
        estimate = gtsam.utilities.extractPose2(self.tree.calculateEstimate())
        return np.asarray(estimate, dtype=np.float64).reshape(-1, 3)

    def calibration_values(self) -> Floats:
        """(4,) the wheels' calibration on the newest stretch."""
        return np.asarray(self.tree.calculateEstimateVector(calibration_key(self.stretches - 1)))

    def calibrations(self) -> Floats:
        """(k, 4) the wheels' calibration on each stretch of the path."""
        keys = [calibration_key(stretch) for stretch in range(self.stretches)]
        return np.array([self.tree.calculateEstimateVector(key) for key in keys])

    def calibration_sigmas(self) -> Floats:
        """(4,) marginal sigmas of the calibration on the newest stretch."""
        covariance = self.tree.marginalCovariance(calibration_key(self.stretches - 1))
        return np.sqrt(np.maximum(np.diag(covariance), MIN_VARIANCE))

    def covariance(self, keyframe: int) -> Floats:
        """(3, 3) marginal covariance of a keyframe's pose, in (x, y, theta) of `map`."""
        marginal = np.asarray(self.tree.marginalCovariance(pose_key(keyframe)))
        return covariance_in_b(marginal, -self.pose(keyframe).theta)

    def relative_covariance(self, a: int, b: int) -> Floats:
        """(3, 3) covariance of T_a_b in (x, y, theta) of a, from the joint marginal."""
        T_a_b = self.pose(a).between(self.pose(b))
        J = np.hstack([-adjoint(T_a_b.inverse()), np.eye(3)])
        R, _ = self.tree.jointBayesNet(pose_key(a), pose_key(b)).matrix()  # faster than gtsam's joint covariance
        root = J @ np.linalg.inv(R)
        return covariance_in_b(root @ root.T, -T_a_b.theta)

    def place_covariance(self, a: int, b: int, place_b: Floats) -> Floats:
        """(2, 2) covariance, in a's axes, of the position in keyframe a of `place_b` (2,) m in keyframe b."""
        turned = self.pose(a).between(self.pose(b)).theta
        x, y = Pose2(0.0, 0.0, turned).transform(place_b[None])[0]
        J = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])
        covariance: Floats = J @ self.relative_covariance(a, b) @ J.T
        return covariance

    def _note_order(self, result: gtsam.ISAM2Result) -> None:
        """Note whether an update has left the tree deep, which the next one cures."""
        touched = result.getVariablesReeliminated()
        self._reordered = self.keyframes > 2 * BLOCK and touched > REORDERED_SHARE * self.keyframes

    def _eliminate_again(self, keyframes: Sequence[int], held: gtsam.KeyList) -> None:
        if keyframes:
            stretches = sorted({min(self._chain.stretch_of(k), self.stretches - 1) for k in keyframes})
            params = dissection(keyframes, stretches, self._axes_states.of(keyframes))
            params.noRelinKeys = held
            self.tree.update(gtsam.NonlinearFactorGraph(), gtsam.Values(), params)
            self._reordered = False


def _params(config: BackendConfig) -> gtsam.ISAM2Params:
    thresholds = gtsam.ISAM2ThresholdMap()
    thresholds.insert(("x", np.array([config.relinearize_m, config.relinearize_m, config.relinearize_rad])))
    thresholds.insert(("c", np.full(4, config.relinearize_calibration)))
    thresholds.insert(("d", np.full(1, config.relinearize_rad)))
    params = gtsam.ISAM2Params()
    params.setRelinearizeThreshold(thresholds)
    params.setFactorization("QR")  # Cholesky breaks down over long chains of wheels with one loose calibration
    params.relinearizeSkip = 1  # look for states to relinearise at every update
    params.enablePartialRelinearizationCheck = True
    return params
