"""Finds where the robot drove along the axes of its building, and so its heading, from the wheels alone.

Walls, corridors and aisles mostly stand at right angles, and robots mostly drive along them. The idea is the heuristic
drift elimination of Borenstein and Ojeda (Journal of Navigation 63, 2010); here a Gaussian-sum filter (Sorenson and
Alspach, Automatica 7, 1971) decides what was driven along an axis. A hypothesis has the state (heading, turn bias in
rad/m, turn scale, direction of the axes), and for each sample of the path the axis along which it was driven, or none.

The evidence of axes is the likelihood of the whole path over that of headings which may be anything, so that a wide
prior must pay for itself. Wings of a building stand at angles to each other: a hypothesis may begin a new wing.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.wheel_calibration import WheelCalibration, WheelMotion
from wayfi.backend.pose2 import Floats
from wayfi.frontends.axes.wall_direction import QUARTER
from wayfi.frontends.odometry.odometry_config import AxesConfig

Ints = NDArray[np.int64]
Rows = Ints | NDArray[np.bool_]

HEADING, BIAS, SCALE, AXES = range(4)
_DIRECTIONS = 8  # Gaussians over the direction of the axes at first: 0.2 rad apart
_START_RAD = 1e-3  # sigma of the heading at the start, which defines the frame
_MOST = 48  # hypotheses kept: a sample splits each into up to five, most of them improbable
_LEAST = 18.0  # nats below all others together: such a hypothesis never comes back
_ALIKE = 0.3  # sigmas, in every component: hypotheses nearer to each other count as one
_SURE_RAD = 0.25  # predictive sigma; above it the axis next to the nearest may be meant as well
_TURNED_RAD = 0.25  # off the axes: a wing turned by less is not told from the one before
_HELD = 64  # samples held back at most until there is evidence: 128 m
_NONE = 1 << 20  # label of a sample along no axis, or along one of another wing than the present
_REFERENCE, _OLDEST = 0, 1  # columns of the labels


@dataclass(frozen=True, slots=True)
class AlongAxis:
    """At the end of step `step`, counted from 1, the robot headed `turned` rad from an axis of wing `wing`, from 1.

    The wheels may have slipped sideways since the end of step `doubtful_from`, by about `slipped` rad.
    """

    step: int
    wing: int
    turned: float
    doubtful_from: int
    slipped: float


@dataclass(frozen=True, slots=True)
class _Sample:
    """At the end of step `step` the robot headed `ahead` rad less than on average in the sample.

    The wheels had `turned` rad and driven `path_m` by then.
    """

    step: int
    ahead: float
    turned: float
    path_m: float


@dataclass(frozen=True, slots=True, eq=False)
class _Hypotheses:
    """`mean` (h, 4) and `covariance` (h, 4, 4) of the state, `log_weight` (h,), and `labels` (h, n) of n samples.

    A label is the number of quarter turns from the axes' direction, or _NONE. The samples are the last one that was
    decided, the reference, and those that are undecided.
    """

    mean: Floats
    covariance: Floats
    log_weight: Floats
    labels: Ints

    def chosen(self, rows: Rows) -> "_Hypotheses":
        return _Hypotheses(self.mean[rows], self.covariance[rows], self.log_weight[rows], self.labels[rows])

    def labelled(self, gain: Floats | float, label: Ints | int) -> "_Hypotheses":
        """With one more sample of this `label`, which multiplies the weights by exp(gain)."""
        column = np.broadcast_to(np.asarray(label), self.log_weight.shape)[:, None]
        return replace(self, log_weight=self.log_weight + gain, labels=np.hstack([self.labels, column]))


class BuildingAxes:
    """The filter; `add` takes the wheels' motions in order, `settled` returns the samples that have been decided."""

    def __init__(self, heading: float, calibration: WheelCalibration, config: AxesConfig) -> None:
        """Begin at `heading` (rad) in `map`, which counts as known, with what is known of the wheels."""
        self._config = config
        (_, scale, bias, _), (_, scale_sigma, bias_sigma, _) = calibration.values, calibration.sigmas
        width = QUARTER / _DIRECTIONS
        directions = heading + width * (np.arange(_DIRECTIONS) + 0.5) - QUARTER / 2
        mean = np.column_stack([np.tile([heading, bias, scale], (_DIRECTIONS, 1)), directions])
        covariance = np.diag([_START_RAD, bias_sigma, scale_sigma, width / 2]) ** 2
        weight, labels = np.full(_DIRECTIONS, -math.log(_DIRECTIONS)), np.full((_DIRECTIONS, 1), _NONE)
        self._all = _Hypotheses(mean, np.tile(covariance, (_DIRECTIONS, 1, 1)), weight, labels)
        self._share = config.share_along
        self._steps = self._wing = self._quarters = 0
        self._since: list[tuple[float, float]] = []
        self._undecided: list[_Sample] = []
        self._turned = self._path_m = 0.0
        self._last: tuple[_Sample, AlongAxis] | None = None
        self.evidence = 0.0

    @property
    def calibration(self) -> tuple[float, float]:
        """Turn scale and turn bias (rad/m), the mean of all hypotheses."""
        mean = np.exp(self._all.log_weight) @ self._all.mean
        return float(mean[SCALE]), float(mean[BIAS])

    def add(self, motion: WheelMotion, variance: float) -> None:
        """Predict by the next motion, whose turn errs at random by `variance` (rad^2); takes a sample if one is due."""
        self._steps += 1
        self._turned, self._path_m = self._turned + motion.pose.theta, self._path_m + motion.path_m
        self._predict(motion.pose.theta, motion.path_m, variance)
        self._since = [(ahead - motion.pose.theta, m) for ahead, m in self._since] + [(0.0, motion.path_m)]
        length_m = sum(m for _, m in self._since)
        if length_m >= self._config.sample_m:
            headings, lengths = np.array(self._since).T
            ahead = float(headings @ lengths) / length_m
            self._since = []
            if np.ptp(headings) > self._config.turning_rad:
                return
            self._undecided.append(_Sample(self._steps, ahead, self._turned, self._path_m))
            self._split(ahead)
            if len(self._undecided) > _HELD:
                self._forget_oldest()

    def settled(self) -> list[AlongAxis]:
        """The samples that were driven along an axis, as far as they are decided by now; each once, in order."""
        settled: list[AlongAxis] = []
        while self.evidence >= self._config.min_evidence and len(self._undecided) > self._config.samples_after:
            sample = self._undecided[0]
            if decided := self._decide(sample):
                settled.append(decided)
                self._last = sample, decided
            self._forget_oldest()
        return settled

    def _predict(self, turn: float, path_m: float, variance: float) -> None:
        F = np.eye(4)
        F[HEADING, BIAS], F[HEADING, SCALE] = path_m, turn
        noise = np.diag([variance, self._config.walk_rad_per_m**2 * path_m, 0.0, 0.0])
        mean = self._all.mean @ F.T + [turn, 0.0, 0.0, 0.0]
        self._all = replace(self._all, mean=mean, covariance=F @ self._all.covariance @ F.T + noise)

    def _split(self, ahead: float) -> None:
        """Judge a sample of the path, in which the mean heading was that of its end and `ahead` (rad)."""
        off = self._all.mean[:, HEADING] + ahead - self._all.mean[:, AXES]
        nearest = np.round(off / QUARTER)
        along, other = math.log(self._share), self._config.share_other_wing
        parts = [self._all.labelled(math.log(1 - self._share), _NONE)]
        parts += [self._along(self._all, off, nearest + k, along + math.log(1 - other), k == 0) for k in (0, -1, 1)]
        parts.append(self._after_slip(off, nearest, along + math.log(self._config.share_slip)))
        parts.append(self._in_other_wing(ahead, np.abs(off - nearest * QUARTER), along + math.log(other)))
        joined = _joined(parts)
        total = _log_sum(joined.log_weight)
        self.evidence += total
        self._all = _reduced(replace(joined, log_weight=joined.log_weight - total))
        share = float(np.exp(self._all.log_weight)[self._all.labels[:, -1] != _NONE].sum())
        share = min(share, self._config.most_along)
        self._share += (share - self._share) / self._config.memory_samples

    def _after_slip(self, off: Floats, nearest: Floats, gain: float) -> _Hypotheses:
        """The hypotheses that the wheels have slipped sideways since the sample before, which is along the axes."""
        rows = np.abs(off - nearest * QUARTER) > self._config.sigma_rad
        before = self._all.chosen(rows)
        slip = np.diag([self._config.slip_rad**2, 0.0, 0.0, 0.0])
        return self._along(
            replace(before, covariance=before.covariance + slip), off[rows], nearest[rows], gain, is_nearest=True
        )

    def _along(self, before: _Hypotheses, off: Floats, axis: Floats, gain: float, is_nearest: bool) -> _Hypotheses:
        """Hypotheses updated by a sample `off` (h,) rad from the axes' direction, driven along `axis` (h,)."""
        P = before.covariance
        along = P[:, :, HEADING] - P[:, :, AXES]
        variance = along[:, HEADING] - along[:, AXES] + self._config.sigma_rad**2
        error = off - axis * QUARTER
        K = along / variance[:, None]
        updated = replace(
            before,
            mean=before.mean - K * error[:, None],
            covariance=P - K[:, :, None] * along[:, None, :],
        )
        density = np.exp(-0.5 * error**2 / variance) / np.sqrt(2 * math.pi * variance)
        split = updated.labelled(gain + np.log(np.maximum(density * QUARTER, 1e-300)), axis.astype(np.int64))
        return split if is_nearest else split.chosen(variance > _SURE_RAD**2)

    def _in_other_wing(self, ahead: float, off: Floats, gain: float) -> _Hypotheses:
        """The hypotheses `off` (h,) rad from the axes, each with the direction of a new wing's axes from the sample."""
        F = np.eye(4)
        F[AXES] = F[HEADING]
        mean = self._all.mean @ F.T + [0.0, 0.0, 0.0, ahead]
        covariance = F @ self._all.covariance @ F.T + np.diag([0.0, 0.0, 0.0, self._config.sigma_rad**2])
        before = np.full_like(self._all.labels, _NONE)
        begun = replace(self._all, mean=mean, covariance=covariance, labels=before)
        return begun.labelled(gain, 0).chosen(off > _TURNED_RAD)

    def _decide(self, sample: "_Sample") -> AlongAxis | None:
        """The axis of the oldest sample; of a new wing if the one before does not tell it."""
        weight, labels = np.exp(self._all.log_weight), self._all.labels
        along, related = labels[:, _OLDEST] != _NONE, labels[:, _REFERENCE] != _NONE
        if weight[along].sum() < self._config.min_posterior:
            return None
        turns = labels[:, _OLDEST] - labels[:, _REFERENCE]
        related &= along
        likeliest = turns[np.argmax(weight * related)]
        if weight[related & (turns == likeliest)].sum() >= self._config.min_posterior:
            self._quarters += int(likeliest)
        else:
            self._wing, self._quarters = self._wing + 1, 0
        self._all.labels[:, _REFERENCE] = labels[:, _OLDEST]
        turned = self._quarters * QUARTER - sample.ahead
        return AlongAxis(sample.step, self._wing, turned, *self._slip(sample, turned))

    def _slip(self, sample: "_Sample", turned: float) -> tuple[int, float]:
        """Since which step the wheels may have slipped, and how far: as the axes tell, or in a new wing anyhow."""
        if self._last is None:
            return sample.step, 0.0
        before, along = self._last
        if along.wing != self._wing:
            return along.step, self._config.slip_rad
        scale, bias = self.calibration
        by_wheels = (1 + scale) * (sample.turned - before.turned) + bias * (sample.path_m - before.path_m)
        slipped = abs(turned - along.turned - by_wheels)
        return along.step, slipped if slipped > 2 * self._config.sigma_rad else 0.0

    def _forget_oldest(self) -> None:
        self._undecided.pop(0)
        self._all = replace(self._all, labels=np.delete(self._all.labels, _OLDEST, axis=1))


def _joined(parts: list[_Hypotheses]) -> _Hypotheses:
    return _Hypotheses(
        np.concatenate([part.mean for part in parts]),
        np.concatenate([part.covariance for part in parts]),
        np.concatenate([part.log_weight for part in parts]),
        np.concatenate([part.labels for part in parts]),
    )


def _reduced(hypotheses: _Hypotheses) -> _Hypotheses:
    """The most probable `_MOST` hypotheses, of those alike only the best, with the weight of all of them."""
    order = np.argsort(-hypotheses.log_weight, kind="stable")
    left = hypotheses.chosen(order[hypotheses.log_weight[order] > -_LEAST])
    kept: list[int] = []
    weights: list[float] = []
    open_ = np.ones(len(left.mean), bool)
    while open_.any() and len(kept) < _MOST:
        best = int(np.argmax(open_))
        sigmas = np.sqrt(np.diagonal(left.covariance[best]))
        alike = open_ & (np.abs(left.mean - left.mean[best]) < _ALIKE * sigmas).all(axis=1)
        kept.append(best)
        weights.append(_log_sum(left.log_weight[alike]))
        open_ &= ~alike
    log_weight = np.array(weights)
    return replace(left.chosen(np.array(kept)), log_weight=log_weight - _log_sum(log_weight))


def _log_sum(log_weights: Floats) -> float:
    return float(np.logaddexp.reduce(log_weights))
