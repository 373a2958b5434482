"""closures_*.parquet: the verdict on every loop candidate, and the factors that it has in the graph."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import ClosureJudged, ClosureKind, Verdict
from wayfi.frontends.maps.building_map import MapClosure
from wayfi.recordings.map.columns import Table, lists, parquet
from wayfi.recordings.map.factor_table import COVARIANCE, POSE

STAMPS = ["stamp_a_ns", "stamp_b_ns", "keyframe_a", "keyframe_b"]
SCORES = ["similarity", "residual_m", "inlier_ratio"]
KeptClosure = tuple[MapClosure, bool]  # and whether it is vetoed


def closure_table(numbers: Sequence[int], closures: Sequence[KeptClosure]) -> bytes:
    """The closures `numbers`."""
    judged = [closure.judged for closure, _ in closures]
    poses = np.array([[j.T_a_b.x, j.T_a_b.y, j.T_a_b.theta] for j in judged]).reshape(-1, 3)
    covariances = np.array([j.covariance for j in judged]).reshape(-1, 9)
    columns: dict[str, Any] = {
        "closure": np.array(numbers, np.int64),
        **{name: np.array([getattr(j, name) for j in judged], np.int64) for name in STAMPS},
        "kind": np.array([j.kind.value for j in judged], np.str_),
        "proposed_by": np.array([j.proposed_by for j in judged], np.str_),
        **{name: np.array([getattr(j, name) for j in judged], np.float64) for name in SCORES},
        **{name: poses[:, k] for k, name in enumerate(POSE)},
        **{name: covariances[:, k] for k, name in enumerate(COVARIANCE)},
        "heading_claimed": np.array([j.heading_claimed for j in judged], bool),
        "verdict": np.array([j.verdict.value for j in judged], np.str_),
        "reason": np.array([j.reason for j in judged], np.str_),
        "factors": lists([np.array(closure.factors, np.int64) for closure, _ in closures]),
        "vetoed": np.array([vetoed for _, vetoed in closures], bool),
    }
    return parquet(columns)


def read_closures(table: Table) -> dict[int, KeptClosure]:
    """The closures in a table by their numbers. Raises KeyError or ValueError for a table of another kind."""
    stamps, scores = list(zip(*map(table.values, STAMPS), strict=True)), table.matrix(SCORES).tolist()
    poses, covariances = table.matrix(POSE).tolist(), table.matrix(COVARIANCE).reshape(-1, 3, 3)
    names = ["kind", "proposed_by", "heading_claimed", "verdict", "reason", "vetoed"]
    said = list(zip(*map(table.values, names), strict=True))
    factors, read = table.lists("factors"), {}
    for k, number in enumerate(table.values("closure")):
        (stamp_a_ns, stamp_b_ns, a, b), (similarity, residual_m, inliers) = stamps[k], scores[k]
        kind, proposed_by, heading_claimed, verdict, reason, vetoed = said[k]
        judged = ClosureJudged(
            number, stamp_a_ns, stamp_b_ns, a, b, ClosureKind(kind), proposed_by, similarity, residual_m, inliers,
            Pose2(*poses[k]), covariances[k], heading_claimed, Verdict(verdict), reason,
        )  # fmt: skip
        read[number] = MapClosure(judged, tuple(factors[k].tolist())), vetoed
    return read
