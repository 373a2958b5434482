"""The pose graph as g2o's text format: VERTEX_SE2 and EDGE_SE2 (Kümmerle et al., ICRA 2011)."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.factors import in_b
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.backend.pose_graph import Between, Factor
from wayfi.recordings.files import write_text


def write_g2o(path: Path, poses: Floats, factors: Iterable[Factor], calibration: Floats) -> None:
    """Write keyframes' `poses` (n, 3) in `map` and `factors`; wheels as `calibration` (4,) corrects them.

    An edge's information is in the axes of its second pose, as g2o takes it.
    """
    lines = [f"VERTEX_SE2 {k} {_numbers(pose)}" for k, pose in enumerate(poses)]
    for factor in factors:
        T = factor.T_a_b if isinstance(factor, Between) else factor.motion.corrected(calibration)
        lines.append(f"EDGE_SE2 {factor.a} {factor.b} {_numbers(T.array())} {_information(T, factor.covariance)}")
    if len(poses):
        lines.append("FIX 0")  # last: some readers stop at it
    write_text(path, "\n".join(lines) + "\n")


def _information(T_a_b: Pose2, covariance: Floats) -> str:
    information = np.linalg.inv(in_b(covariance, T_a_b.theta))
    return _numbers(information[np.triu_indices(3)])


def _numbers(values: NDArray[np.floating[Any]]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
