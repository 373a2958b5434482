"""Scores of closures against a reference: precision, covariance consistency (NEES) and recall of revisits."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from wayfi.backend.pose2 import Floats, between_all, wrap_all
from wayfi.frontends.events import ClosureKind, Verdict
from wayfi.recordings.files.tables import ClosureRow
from wayfi.recordings.trajectory import Flags, Trajectory
from wayfi.service.evaluation.trajectory_scores import ScoringError

CORRECT_WITHIN = {ClosureKind.WIFI: (3.0, 0.3), ClosureKind.LIDAR: (0.3, 0.05), ClosureKind.FIX: (0.6, 0.2)}  # m, rad
REFERENCE_WITHIN_S = 1.0
MIN_CLOSURES_FOR_NEES = 20
REVISIT_PATH_M, REVISIT_WITHIN_M, RECALLED_WITHIN_M = 50.0, 3.0, 5.0
_STEP_M = 1.0


@dataclass(frozen=True, slots=True)
class ClosureScore:
    """The accepted closures of one kind; None for a figure without enough closures.

    `scored` counts those with a reference at both ends, `right` the scored ones within the bounds of their kind on
    position and, if claimed, heading. `nees` is the mean of e' S^-1 e / (claimed dimensions); it is 1 for a consistent
    covariance, and more for an overconfident one.
    """

    accepted: int
    scored: int
    right: int
    precision: float | None
    position_median_m: float | None
    heading_median_rad: float | None
    nees: float | None


@dataclass(frozen=True, slots=True)
class Recall:
    """The reference's revisits, one for each metre of path, and how many are `answered` by a closure."""

    revisits: int
    answered: int
    recall: float | None


def accepted_of(rows: Sequence[ClosureRow]) -> list[ClosureRow]:
    """The rows whose final verdict is accepted."""
    return [row for row in rows if row.verdict is Verdict.ACCEPTED]


def score_closures(rows: Sequence[ClosureRow], truth: Trajectory) -> dict[ClosureKind, ClosureScore]:
    """The scores of the accepted closures of each kind against `truth`."""
    accepted = accepted_of(rows)
    return {kind: _score([row for row in accepted if row.kind is kind], truth) for kind in ClosureKind}


def is_correct(rows: Sequence[ClosureRow], truth: Trajectory) -> Flags:
    """(n,) whether each closure is within the bounds of its kind; False without a reference."""
    correct = has_reference(rows, truth)
    known = [row for row, flag in zip(rows, correct, strict=True) if flag]
    correct[correct] = _within_bounds(known, _errors(known, truth))
    return correct


def has_reference(rows: Sequence[ClosureRow], truth: Trajectory) -> Flags:
    """(n,) whether both stamps of each closure are within 1 s of a stamp of `truth`."""
    stamps = _stamps(rows)
    near = [truth.nearest_s(stamps[:, end]) <= REFERENCE_WITHIN_S for end in (0, 1)]
    return near[0] & near[1]


def score_recall(rows: Sequence[ClosureRow], truth: Trajectory) -> Recall:
    """The share of revisits that accepted closures answer.

    A revisit is a point of the reference (one for each metre of its path) with an earlier point at least 50 m of path
    before it and at most 3 m away. A closure answers it if its stamps are within 5 m, along the path, of the revisit
    and of one of those earlier points.
    """
    pairs = _revisits(truth)
    revisits = np.unique(pairs[:, 1])
    answered = np.unique(pairs[_answered(pairs, accepted_of(rows), truth), 1])
    share = answered.size / revisits.size if revisits.size else None
    return Recall(revisits.size, answered.size, share)


def _score(rows: list[ClosureRow], truth: Trajectory) -> ClosureScore:
    scored = [row for row, known in zip(rows, has_reference(rows, truth), strict=True) if known]
    if not scored:
        return ClosureScore(len(rows), 0, 0, None, None, None, None)
    errors = _errors(scored, truth)
    right = int(_within_bounds(scored, errors).sum())
    headings = np.abs(errors[np.isfinite(errors[:, 2]), 2])
    return ClosureScore(
        accepted=len(rows),
        scored=len(scored),
        right=right,
        precision=right / len(scored),
        position_median_m=float(np.median(np.hypot(*errors[:, :2].T))),
        heading_median_rad=float(np.median(headings)) if headings.size else None,
        nees=_nees(scored, errors) if len(scored) >= MIN_CLOSURES_FOR_NEES else None,
    )


def _stamps(rows: Sequence[ClosureRow]) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    return np.array([(row.stamp_a_ns, row.stamp_b_ns) for row in rows], np.int64).reshape(-1, 2)


def _errors(rows: Sequence[ClosureRow], truth: Trajectory) -> Floats:
    """(n, 3) errors in (x, y, theta) of a, m and rad; theta is NaN if no heading is claimed."""
    stamps = _stamps(rows)
    true = between_all(truth.at(stamps[:, 0]), truth.at(stamps[:, 1]))
    errors = np.array([row.T_a_b.array() for row in rows]).reshape(-1, 3) - true
    errors[:, 2] = wrap_all(errors[:, 2])
    errors[[not row.heading_claimed for row in rows], 2] = np.nan
    return errors


def _within_bounds(rows: Sequence[ClosureRow], errors: Floats) -> Flags:
    bound_m, bound_rad = np.array([CORRECT_WITHIN[row.kind] for row in rows]).reshape(-1, 2).T
    x, y, theta = errors.T
    right: Flags = (np.hypot(x, y) <= bound_m) & (np.isnan(theta) | (np.abs(theta) <= bound_rad))
    return right


def _nees(rows: Sequence[ClosureRow], errors: Floats) -> float:
    """The mean of e' S^-1 e / (claimed dimensions)."""
    return float(np.mean([_normalised_squared_error(row, error) for row, error in zip(rows, errors, strict=True)]))


def _normalised_squared_error(row: ClosureRow, error: Floats) -> float:
    size = 3 if row.heading_claimed else 2
    try:
        factor = np.linalg.cholesky(row.covariance[:size, :size])
    except np.linalg.LinAlgError as problem:
        stamps = f"{row.stamp_a_ns} and {row.stamp_b_ns}"
        raise ScoringError(f"closure between {stamps}: its covariance is not positive definite") from problem
    return float(np.sum(np.linalg.solve(factor, error[:size]) ** 2) / size)


def _revisits(truth: Trajectory) -> Floats:
    """(n, 2) distances along the path (m) of an earlier point and its revisit."""
    path_m, first = np.unique(truth.path_m(), return_index=True)
    at_m = np.arange(0.0, path_m[-1] + 1e-9, _STEP_M)
    places = np.stack([np.interp(at_m, path_m, truth.poses[first, k]) for k in (0, 1)], axis=1)
    pairs = at_m[cKDTree(places).query_pairs(REVISIT_WITHIN_M, output_type="ndarray")]
    far: Floats = np.sort(pairs.reshape(-1, 2), axis=1)
    return far[far[:, 1] - far[:, 0] >= REVISIT_PATH_M]


def _answered(pairs: Floats, accepted: Sequence[ClosureRow], truth: Trajectory) -> Flags:
    """(n,) whether a closure connects the two points of each pair."""
    if not accepted:
        return np.zeros(len(pairs), bool)
    ends = np.interp(truth.seconds(_stamps(accepted)), truth.seconds(truth.stamps_ns), truth.path_m())
    distance, _ = cKDTree(np.sort(ends, axis=1)).query(pairs, p=np.inf)
    answered: Flags = distance <= RECALLED_WITHIN_M
    return answered
