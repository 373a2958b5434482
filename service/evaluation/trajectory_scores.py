"""How far a trajectory is from a reference: ATE, RPE and hand-checked relations, in numpy alone.

The estimate is interpolated at the reference's stamps; a stamp more than 0.5 s outside the estimate, or in a gap of it
of more than 15 s, is not scored but counted.
"""

from collections.abc import Sequence
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
    """ATE: distances after the best SE(2) alignment, and how many reference poses they are of."""

    ate_rmse_m: float
    ate_median_m: float
    ate_max_m: float
    heading_rmse_deg: float
    scored: int
    not_covered: int


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """An estimate laid over a reference: `errors_m` (n,) are left at the reference's `stamps_ns` (n,)."""

    T_reference_estimate: Pose2
    stamps_ns: Stamps
    errors_m: Floats
    error: AbsoluteError


@dataclass(frozen=True, slots=True)
class RelativeError:
    """RPE over one stated distance along the reference; the figures are None where no two poses are so far apart."""

    distance_m: float
    translation_rmse_m: float | None
    heading_rmse_deg: float | None
    pairs: int


@dataclass(frozen=True, slots=True, eq=False)
class Relations:
    """Hand-checked relative poses (n, 3), x, y (m), theta (rad) of stamp b in stamp a; stamps are (n,)."""

    stamps_a_ns: Stamps
    stamps_b_ns: Stamps
    T_a_b: Floats

    def only(self, flags: Flags) -> "Relations":
        """Those whose flag is set."""
        return Relations(self.stamps_a_ns[flags], self.stamps_b_ns[flags], self.T_a_b[flags])


@dataclass(frozen=True, slots=True)
class RelationError:
    """Mean error against hand-checked relations (Kuemmerle et al. 2009); None where none is scored."""

    translation_mean_m: float | None
    translation_std_m: float | None
    translation_max_m: float | None
    rotation_mean_deg: float | None
    rotation_std_deg: float | None
    scored: int
    not_covered: int


def align(source_xy: Floats, target_xy: Floats) -> Pose2:
    """T_target_source, the SE(2) that lays (n, 2) points best on (n, 2) points (Umeyama 1991, without scale)."""
    source_mean, target_mean = source_xy.mean(axis=0), target_xy.mean(axis=0)
    a, b = source_xy - source_mean, target_xy - target_mean
    theta = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    turned = Pose2(0.0, 0.0, float(theta)).transform(source_mean)
    return Pose2.of((*(target_mean - turned), theta))


def absolute_error(estimate: Trajectory, reference: Trajectory) -> Alignment:
    """ATE of `estimate`. Raises ScoringError where it covers fewer than two poses of the reference."""
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


def relative_error(
    estimate: Trajectory, reference: Trajectory, distances_m: Sequence[float] = RPE_DISTANCES_M
) -> list[RelativeError]:
    """RPE: each reference pose against the first one at least a stated distance of path after it."""
    covered = estimate.covers(reference.stamps_ns, EDGE_S, GAP_S)
    poses, true = estimate.at(reference.stamps_ns[covered]), reference.poses[covered]
    path_m = reference.path_m()[covered]
    return [_relative_error(poses, true, path_m, distance) for distance in distances_m]


def _relative_error(poses: Floats, true: Floats, path_m: Floats, distance_m: float) -> RelativeError:
    after = np.searchsorted(path_m, path_m + distance_m)
    a = np.flatnonzero(after < len(path_m))
    if a.size == 0:
        return RelativeError(distance_m, None, None, 0)
    b = after[a]
    errors = between_all(between_all(true[a], true[b]), between_all(poses[a], poses[b]))
    return RelativeError(distance_m, _rms(np.hypot(*errors[:, :2].T)), _rms(np.degrees(errors[:, 2])), a.size)


def relation_error(estimate: Trajectory, relations: Relations, on_scan_s: float | None = None) -> RelationError:
    """Error of `estimate` against `relations`; with `on_scan_s`, those with both stamps that near to a pose of it."""
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
