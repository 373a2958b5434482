"""The figures of a column of Tables I and II, and the errors of closures."""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats, between_all
from wayfi.recordings.trajectory import Flags, Stamps, Trajectory
from wayfi.service.evaluation.trajectory_scores import EDGE_S, GAP_S


@dataclass(frozen=True, slots=True)
class SweepFigures:
    """The number of closures, their mean errors, the time to find them and the ATE with them; None if unknown."""

    closures: int | None = None
    position_m: float | None = None
    orientation_rad: float | None = None
    seconds: float | None = None
    ate_m: float | None = None


def closure_errors(
    stamps_ns: Stamps, T_a_b: Floats, truth: Trajectory, heading_claimed: Flags | None = None
) -> tuple[float | None, float | None]:
    """The mean errors (m, rad) of closures `T_a_b` (m, 3) between `stamps_ns` (m, 2); None without closures.

    The orientation error is of closures with `heading_claimed` (m,) (None: all). Closures with an end that `truth` does
    not cover are excluded.
    """
    known = np.all([truth.covers(stamps_ns[:, end], EDGE_S, GAP_S) for end in (0, 1)], axis=0)
    true = between_all(*(truth.at(stamps_ns[known, end]) for end in (0, 1)))
    errors = between_all(true, T_a_b[known])
    turns = np.abs(errors[:, 2] if heading_claimed is None else errors[heading_claimed[known], 2])
    return _mean(np.hypot(errors[:, 0], errors[:, 1])), _mean(turns)


def _mean(values: Floats) -> float | None:
    return float(values.mean()) if len(values) else None
