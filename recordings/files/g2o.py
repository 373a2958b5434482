"""The pose graph as g2o's text format: VERTEX_SE2 and EDGE_SE2 (Kümmerle et al., ICRA 2011)."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.factors import AxisFactor, BetweenFactor, Factor, NearFactor, RelativeFactor
from wayfi.backend.pose2 import Floats, Pose2, covariance_in_b, pose_of_common_place
from wayfi.recordings.files.atomic_files import write_text


def write_g2o(path: Path, poses: Floats, factors: Iterable[Factor], calibration: Floats) -> None:
    """Write the text of a graph. Raises OSError."""
    write_text(path, g2o_text(poses, factors, calibration))


def g2o_text(poses: Floats, factors: Iterable[Factor], calibration: Floats) -> str:
    """The keyframes' `poses` (n, 3), T_map_base, and the `factors` between them.

    A wheel factor is written with the motion that `calibration` (4,) gives; a factor of one keyframe is no edge. g2o
    expects the information matrix of an edge in the axes of its second pose.
    """
    lines = [f"VERTEX_SE2 {k} {_numbers(pose)}" for k, pose in enumerate(poses)]
    lines += [_edge(factor, poses, calibration) for factor in factors if not isinstance(factor, AxisFactor)]
    if len(poses):
        lines.append("FIX 0")  # last, because some readers stop at it
    return "\n".join(lines) + "\n"


def _edge(factor: RelativeFactor, poses: Floats, calibration: Floats) -> str:
    if isinstance(factor, NearFactor):
        T, information = _near(factor, poses)
    else:
        T = factor.T_a_b if isinstance(factor, BetweenFactor) else factor.motion.corrected(calibration)
        information = _information(T, factor.covariance)
    upper = information[np.triu_indices(3)]
    return f"EDGE_SE2 {factor.a} {factor.b} {_numbers(T.array())} {_numbers(upper)}"


def _information(T_a_b: Pose2, covariance: Floats) -> Floats:
    return np.asarray(np.linalg.inv(covariance_in_b(covariance, T_a_b.theta)), np.float64)


def _near(factor: NearFactor, poses: Floats) -> tuple[Pose2, Floats]:
    """The edge of two coinciding points, with the poses' own heading: rank 2, the rotation about them is free."""
    turned = Pose2.of(poses[factor.a]).between(Pose2.of(poses[factor.b])).theta
    moved = np.column_stack([np.eye(2), (-factor.place_b[1], factor.place_b[0])])
    return pose_of_common_place(factor.place_a, factor.place_b, turned), np.asarray(
        moved.T @ moved / factor.sigma_m**2, np.float64
    )


def _numbers(values: NDArray[np.floating[Any]]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
