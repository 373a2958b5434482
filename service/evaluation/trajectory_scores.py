"""Errors of a trajectory against a reference: ATE, RPE and hand-checked relations.

The estimate is interpolated at the reference's stamps. Stamps more than 0.5 s outside the estimate, or in a gap of more
than 15 s, are counted as not covered.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Floats, Pose2, between_all, compose_all, wrap_all
from wayfi.recordings.trajectory import Flags, Stamps, Trajectory

EDGE_S, GAP_S = 0.5, 15.0
RPE_DISTANCES_M = (1.0, 10.0, 50.0)


class ScoringError(WayfiError):
    """Trajectories that cannot be compared."""


@dataclass(frozen=True, slots=True)
class AbsoluteError:
    """The absolute trajectory error after the best SE(2) alignment; `scored` counts reference poses."""

    ate_rmse_m: float
    ate_median_m: float
    ate_max_m: float
    heading_rmse_deg: float
    scored: int
    not_covered: int


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """An estimate aligned to a reference, with the position errors `errors_m` (n,) at the reference's `stamps_ns`."""

    T_reference_estimate: Pose2
    stamps_ns: Stamps
    errors_m: Floats
    error: AbsoluteError


@dataclass(frozen=True, slots=True)
class RelativeError:
    """The relative pose error over `distance_m` along the reference; None if the path is shorter."""

    distance_m: float
    translation_rmse_m: float | None
    heading_rmse_deg: float | None
    pairs: int


@dataclass(frozen=True, slots=True, eq=False)
class Relations:
    """Hand-checked relative poses `T_a_b` (n, 3), x, y (m), theta (rad), between stamps (n,)."""

    stamps_a_ns: Stamps
    stamps_b_ns: Stamps
    T_a_b: Floats

    def only(self, flags: Flags) -> "Relations":
        """The relations whose flag is set."""
        return Relations(self.stamps_a_ns[flags], self.stamps_b_ns[flags], self.T_a_b[flags])


@dataclass(frozen=True, slots=True)
class RelationError:
    """Errors against hand-checked relations (Kuemmerle et al. 2009); None if none is scored."""

    translation_mean_m: float | None
    translation_std_m: float | None
    translation_max_m: float | None
    rotation_mean_deg: float | None
    rotation_std_deg: float | None
    scored: int
    not_covered: int


def align(source_xy: Floats, target_xy: Floats) -> Pose2:
    """T_target_source with the least squares error over pairs of points (n, 2) (Umeyama 1991, without scale)."""
    source_mean, target_mean = source_xy.mean(axis=0), target_xy.mean(axis=0)
    a, b = source_xy - source_mean, target_xy - target_mean
    theta = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    turned = Pose2(0.0, 0.0, float(theta)).transform(source_mean)
    return Pose2.of((*(target_mean - turned), theta))


def absolute_error(estimate: Trajectory, reference: Trajectory) -> Alignment:
    """The ATE of `estimate`. Raises ScoringError if it covers fewer than two poses of the reference."""
    covered = estimate.covers(reference.stamps_ns, EDGE_S, GAP_S)
    if covered.sum() < 2:
        raise ScoringError("the trajectory and the reference share no time; are they of the same recording?")
    poses, true = estimate.at(reference.stamps_ns[covered]), reference.poses[covered]
    T = align(poses[:, :2], true[:, :2])
    aligned = compose_all(T.array(), poses)
    errors = np.hypot(*(aligned - true)[:, :2].T)
    error = AbsoluteError(
        ate_rmse_m=_rms(errors),
        ate_median_m=float(np.median(errors)),
        ate_max_m=float(errors.max()),
        heading_rmse_deg=_rms(np.degrees(wrap_all(aligned[:, 2] - true[:, 2]))),
        scored=int(covered.sum()),
        not_covered=int((~covered).sum()),
    )
    return Alignment(T, reference.stamps_ns[covered], errors, error)


def relative_error(estimate: Trajectory, reference: Trajectory) -> list[RelativeError]:
    """The RPE for each of RPE_DISTANCES_M: from each reference pose to the first that is so far along the path."""
    covered = estimate.covers(reference.stamps_ns, EDGE_S, GAP_S)
    poses, true = estimate.at(reference.stamps_ns[covered]), reference.poses[covered]
    path_m = reference.path_m()[covered]
    return [_relative_error(poses, true, path_m, distance) for distance in RPE_DISTANCES_M]


def _relative_error(poses: Floats, true: Floats, path_m: Floats, distance_m: float) -> RelativeError:
    after = np.searchsorted(path_m, path_m + distance_m)
    a = np.flatnonzero(after < len(path_m))
    if a.size == 0:
        return RelativeError(distance_m, None, None, 0)
    b = after[a]
    errors = between_all(between_all(true[a], true[b]), between_all(poses[a], poses[b]))
    return RelativeError(distance_m, _rms(np.hypot(*errors[:, :2].T)), _rms(np.degrees(errors[:, 2])), a.size)


def relation_error(estimate: Trajectory, relations: Relations, on_scan_s: float | None = None) -> RelationError:
    """The errors against `relations`; with `on_scan_s`, only of those with both stamps so near to an estimated pose."""
    if on_scan_s is not None:
        ends = relations.stamps_a_ns, relations.stamps_b_ns
        near = [estimate.nearest_s(stamps) <= on_scan_s for stamps in ends]
        relations = relations.only(near[0] & near[1])
    covered = [estimate.covers(s, EDGE_S, GAP_S) for s in (relations.stamps_a_ns, relations.stamps_b_ns)]
    both = covered[0] & covered[1]
    scored, missing = relations.only(both), int((~both).sum())
    if not both.any():
        return RelationError(None, None, None, None, None, 0, missing)
    T_a_b = between_all(estimate.at(scored.stamps_a_ns), estimate.at(scored.stamps_b_ns))
    distance = np.hypot(*(T_a_b - scored.T_a_b)[:, :2].T)
    turn = np.degrees(np.abs(wrap_all(T_a_b[:, 2] - scored.T_a_b[:, 2])))
    return RelationError(*_mean_std(distance), float(distance.max()), *_mean_std(turn), int(both.sum()), missing)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _mean_std(values: NDArray[np.float64]) -> tuple[float, float]:
    return float(values.mean()), float(values.std())
