"""Precision, covariance consistency and recall of closures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from laps import closures_of, loops, rows_of

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import ClosureKind, Verdict
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.closure_scores import has_reference, is_correct, score_closures, score_recall
from wayfi.service.evaluation.trajectory_scores import (
    ScoringError,
)


@pytest.mark.parametrize(
    ("kind", "sigma"), [(ClosureKind.LIDAR, (0.05, 0.08, 0.01)), (ClosureKind.WIFI, (0.6, 0.4, 1.0))]
)
def test_honest_closures_are_right_and_have_a_nees_near_one(
    tmp_path: Path, kind: ClosureKind, sigma: tuple[float, float, float]
) -> None:
    truth = loops()
    score = score_closures(rows_of(tmp_path, closures_of(truth, kind, sigma, 400)), truth)[kind]
    assert (score.accepted, score.scored) == (400, 400)
    assert score.precision is not None
    assert score.precision > 0.97
    assert score.nees == pytest.approx(1.0, abs=0.15)
    assert (score.heading_median_rad is None) == (kind is ClosureKind.WIFI)


def test_bounds_verdicts_and_counts_decide_what_a_closure_is_worth(tmp_path: Path) -> None:
    truth = loops()
    good = closures_of(truth, ClosureKind.LIDAR, (1e-6, 1e-6, 1e-9), 19)
    aside = replace(good[0], closure=19, T_a_b=good[0].T_a_b @ Pose2(0.31, 0.0, 0.0))
    turned = replace(good[1], closure=20, T_a_b=good[1].T_a_b @ Pose2(0.0, 0.0, 0.06))
    refused = replace(aside, closure=21, verdict=Verdict.REFUSED)
    rows = rows_of(tmp_path, [*good, aside, turned, refused])
    score = score_closures(rows, truth)[ClosureKind.LIDAR]
    assert (score.accepted, score.right) == (21, 19)
    assert score.precision == pytest.approx(19 / 21)
    assert is_correct(rows, truth).tolist() == [True] * 19 + [False] * 3
    assert score_closures(rows[:19], truth)[ClosureKind.LIDAR].nees is None
    assert score_closures([], truth)[ClosureKind.WIFI].precision is None


def test_a_closure_far_from_the_references_stamps_is_not_scored(tmp_path: Path) -> None:
    truth = loops()
    judged = closures_of(truth, ClosureKind.LIDAR, (0.01, 0.01, 0.001), 30)
    inside = truth.stamps_ns[0] + 300_000_000_000
    holed = np.abs(truth.stamps_ns - inside) > 30_000_000_000
    rows = rows_of(tmp_path, judged)
    known = has_reference(rows, Trajectory(truth.stamps_ns[holed], truth.poses[holed]))
    in_hole = [any(abs(s - inside) <= 29_000_000_000 for s in (row.stamp_a_ns, row.stamp_b_ns)) for row in rows]
    assert known.tolist() == [not hidden for hidden in in_hole]
    assert 0 < known.sum() < 30


def test_a_covariance_that_is_none_is_refused_by_name(tmp_path: Path) -> None:
    truth = loops()
    judged = closures_of(truth, ClosureKind.LIDAR, (0.01, 0.01, 0.001), 30)
    judged[7] = replace(judged[7], covariance=np.zeros((3, 3)))
    with pytest.raises(ScoringError, match=str(judged[7].stamp_a_ns)):
        score_closures(rows_of(tmp_path, judged), truth)


def test_recall_is_the_share_of_revisits_that_closures_answer(tmp_path: Path) -> None:
    truth = loops()
    rows = rows_of(tmp_path, closures_of(truth, ClosureKind.LIDAR, (0.01, 0.01, 0.001), 60))
    everything = score_recall(rows, truth)
    assert everything.recall == pytest.approx(1.0, abs=0.03)
    assert everything.revisits == pytest.approx(2 * 68, abs=10)
    half = score_recall(rows[:30], truth)
    assert half.recall == pytest.approx(0.53, abs=0.06)
    assert score_recall([], truth).answered == 0
    assert score_recall(rows, loops(400, laps=0.5)).recall is None
