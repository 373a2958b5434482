"""`wayfi evaluate`: the scores of a replay's folder against a reference."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wayfi.frontends.events import ClosureKind
from wayfi.recordings.files.atomic_files import write_text
from wayfi.recordings.files.result_folder import ResultError, why_not_whole
from wayfi.recordings.files.tables import ClosureRow, read_closures
from wayfi.recordings.files.tum import read_tum, stamp_of
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.closure_scores import ClosureScore, Recall, score_closures, score_recall
from wayfi.service.evaluation.trajectory_scores import (
    Alignment,
    RelationError,
    Relations,
    RelativeError,
    ScoringError,
    absolute_error,
    relation_error,
    relative_error,
)

ON_SCAN_S = 0.002


@dataclass(frozen=True, slots=True, eq=False)
class TrajectoryScore:
    """The scores of one trajectory; the relations are None without a file of them."""

    trajectory: Trajectory
    alignment: Alignment
    rpe: list[RelativeError]
    relations: RelationError | None
    relations_on_scan: RelationError | None

    def to_dict(self) -> dict[str, Any]:
        """The figures as plain values for JSON."""
        figures: dict[str, Any] = asdict(self.alignment.error)
        figures["rpe"] = [asdict(error) for error in self.rpe]
        if self.relations and self.relations_on_scan:
            figures["relations"] = asdict(self.relations)
            figures["relations_on_scan"] = asdict(self.relations_on_scan)
        return figures


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """All scores of a replay, and the data of its plots."""

    truth: Trajectory
    final: TrajectoryScore
    online: TrajectoryScore
    rows: list[ClosureRow]
    closures: dict[ClosureKind, ClosureScore]
    recall: Recall

    def to_dict(self) -> dict[str, Any]:
        """`final` and `online` (ate_*, rpe, relations), `closures` by kind, `recall`; None for a missing figure."""
        closures = {kind.value: asdict(score) for kind, score in self.closures.items()}
        return {
            "final": self.final.to_dict(),
            "online": self.online.to_dict(),
            "closures": closures,
            "recall": asdict(self.recall),
        }


def evaluate(directory: Path, truth_path: Path, relations_path: Path | None = None) -> Evaluation:
    """Score trajectory.tum, online.tum and closures.csv of `directory` against `truth_path` (TUM).

    Raises TrajectoryError, TableError or ScoringError (all WayfiError) for a file that is missing, malformed or from
    another time, and ResultError where the run was interrupted.
    """
    if why := why_not_whole(directory):
        raise ResultError(why)
    truth = read_tum(truth_path)
    if len(truth) < 2:
        raise ScoringError(f"{truth_path}: a reference needs at least two poses")
    relations = read_relations(relations_path) if relations_path else None
    rows = read_closures(directory / "closures.csv")
    return Evaluation(
        truth=truth,
        final=_score(directory / "trajectory.tum", truth, relations),
        online=_score(directory / "online.tum", truth, relations),
        rows=rows,
        closures=score_closures(rows, truth),
        recall=score_recall(rows, truth),
    )


def write_evaluation(directory: Path, evaluation: Evaluation) -> None:
    """Write evaluation.json into `directory`. Raises OSError."""
    write_text(directory / "evaluation.json", json.dumps(evaluation.to_dict(), indent=1) + "\n")


def read_relations(path: Path) -> Relations:
    """The relations in `path`, lines of `t1 t2 dx dy dtheta` (s, s, m, m, rad). Raises ScoringError."""
    stamps: list[tuple[int, int]] = []
    poses: list[tuple[float, float, float]] = []
    for number, line in enumerate(_lines(path), 1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            t1, t2, dx, dy, dtheta = line.split()
            stamps.append((stamp_of(t1), stamp_of(t2)))
            poses.append((float(dx), float(dy), float(dtheta)))
        except ValueError as error:
            raise ScoringError(f"{path}, line {number}: not `t1 t2 dx dy dtheta` ({error})") from error
    if not poses:
        raise ScoringError(f"{path}: no relation in it; a line is `t1 t2 dx dy dtheta`")
    stamps_ns = np.array(stamps, np.int64).reshape(-1, 2)
    return Relations(stamps_ns[:, 0], stamps_ns[:, 1], np.array(poses).reshape(-1, 3))


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ScoringError(f"{path}: no relations can be read; is the path right?") from error


def _score(path: Path, truth: Trajectory, relations: Relations | None) -> TrajectoryScore:
    trajectory = read_tum(path)
    try:
        alignment = absolute_error(trajectory, truth)
    except ScoringError as error:
        raise ScoringError(f"{path}: {error}") from error
    return TrajectoryScore(
        trajectory=trajectory,
        alignment=alignment,
        rpe=relative_error(trajectory, truth),
        relations=relation_error(trajectory, relations) if relations else None,
        relations_on_scan=relation_error(trajectory, relations, ON_SCAN_S) if relations else None,
    )
