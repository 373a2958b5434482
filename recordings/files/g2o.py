"""The pose graph as g2o's text format: VERTEX_SE2 and EDGE_SE2 (Kümmerle et al., ICRA 2011)."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

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
    lines = [f"VERTEX_SE2 {k} {numbers}" for k, numbers in enumerate(_numbers(poses))]
    edges = [factor for factor in factors if not isinstance(factor, AxisFactor)]
    motions = [_motion(factor, poses, calibration) for factor in edges]
    numbers = _numbers(np.column_stack([np.array(motions).reshape(-1, 3), _informations(edges, motions)]))
    lines += [f"EDGE_SE2 {edge.a} {edge.b} {of_edge}" for edge, of_edge in zip(edges, numbers, strict=True)]
    if len(poses):
        lines.append("FIX 0")  # last, because some readers stop at it
    return "\n".join(lines) + "\n"


def _motion(factor: RelativeFactor, poses: Floats, calibration: Floats) -> tuple[float, float, float]:
    """x, y and theta from a to b."""
    if isinstance(factor, NearFactor):
        T = pose_of_common_place(factor.place_a, factor.place_b, _turned(factor, poses))
    else:
        T = factor.T_a_b if isinstance(factor, BetweenFactor) else factor.motion.corrected(calibration)
    return T.x, T.y, T.theta


def _turned(factor: NearFactor, poses: Floats) -> float:
    return Pose2.of(poses[factor.a]).between(Pose2.of(poses[factor.b])).theta


def _informations(edges: list[RelativeFactor], motions: list[tuple[float, float, float]]) -> Floats:
    """(n, 6) upper halves of the information matrices of edges with these motions."""
    matrices = np.empty((len(edges), 3, 3))
    covariances: dict[int, Floats] = {}
    for k, edge in enumerate(edges):
        if isinstance(edge, NearFactor):
            matrices[k] = _near_information(edge)
        else:
            covariances[k] = covariance_in_b(edge.covariance, motions[k][2])
    matrices[list(covariances)] = np.linalg.inv(np.array(list(covariances.values())).reshape(-1, 3, 3))
    upper = np.triu_indices(3)
    halves: Floats = matrices[:, upper[0], upper[1]]
    return halves


def _near_information(factor: NearFactor) -> Floats:
    """That of two coinciding points, with the poses' own heading: rank 2, the rotation about them is free."""
    moved = np.column_stack([np.eye(2), (-factor.place_b[1], factor.place_b[0])])
    return np.asarray(moved.T @ moved / factor.sigma_m**2, np.float64)


def _numbers(rows: Floats) -> list[str]:
    """The numbers of each row of (n, m), as text."""
    form = " ".join(["%.9g"] * rows.shape[1])
    return [form % tuple(row) for row in rows.tolist()]
