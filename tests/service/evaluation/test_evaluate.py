import json
import math
import runpy
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import REAL_DATA, SHARED

from wayfi.backend.pose2 import Floats, Pose2, between_all, compose_all
from wayfi.frontends.events import ClosureJudged, ClosureKind, Verdict
from wayfi.recordings.files.tables import ClosureRow, TableError, read_closures, write_closures
from wayfi.recordings.files.tum import TrajectoryError, read_tum, write_tum
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.closure_scores import has_reference, is_correct, score_closures, score_recall
from wayfi.service.evaluation.evaluate import evaluate, read_relations, write_evaluation
from wayfi.service.evaluation.plots import write_plots
from wayfi.service.evaluation.trajectory_scores import (
    ScoringError,
    absolute_error,
    align,
    relation_error,
    relative_error,
)

SCORER = SHARED / "tools" / "score.py"
START_NS = 1_700_000_000_000_000_000
POSES = st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-math.pi, math.pi))


def loops(count: int = 1200, laps: float = 3.0) -> Trajectory:
    """Laps of a 30 x 12 m oval (70 m each), a pose each half second."""
    angle = np.linspace(0, 2 * math.pi * laps, count)
    xy = np.c_[15 * np.cos(angle), 6 * np.sin(angle)]
    heading = np.arctan2(6 * np.cos(angle), -15 * np.sin(angle))
    stamps_ns = START_NS + np.arange(count, dtype=np.int64) * 500_000_000
    return Trajectory(stamps_ns, np.c_[xy, heading])


def moved(trajectory: Trajectory, T: Floats) -> Trajectory:
    return Trajectory(trajectory.stamps_ns, compose_all(T, trajectory.poses))


def noisy(trajectory: Trajectory, sigma_m: float, seed: int = 0) -> Trajectory:
    noise = np.random.default_rng(seed).normal(0, [sigma_m, sigma_m, sigma_m / 5], trajectory.poses.shape)
    return Trajectory(trajectory.stamps_ns, trajectory.poses + noise)


def closures_of(
    truth: Trajectory, kind: ClosureKind, sigma: tuple[float, float, float], count: int = 60, lap: int = 400
) -> list[ClosureJudged]:
    """Closures between places one lap apart, with errors drawn from the covariance that they claim."""
    rng = np.random.default_rng(3)
    a = np.linspace(0, len(truth) - lap - 1, count).astype(int)
    T_a_b = between_all(truth.poses[a], truth.poses[a + lap]) + rng.normal(0, sigma, (count, 3))
    return [
        ClosureJudged(
            closure=k,
            stamp_a_ns=int(truth.stamps_ns[i]),
            stamp_b_ns=int(truth.stamps_ns[i + lap]),
            keyframe_a=int(i),
            keyframe_b=int(i + lap),
            kind=kind,
            proposed_by="wifi",
            similarity=0.5,
            residual_m=0.1,
            inlier_ratio=0.9,
            T_a_b=Pose2.of(T_a_b[k]),
            covariance=np.diag(np.square(sigma)),
            heading_claimed=kind is ClosureKind.LIDAR,
            verdict=Verdict.ACCEPTED,
            reason="",
        )
        for k, i in enumerate(a)
    ]


def rows_of(tmp_path: Path, judged: list[ClosureJudged]) -> list[ClosureRow]:
    write_closures(tmp_path / "closures.csv", judged)
    return read_closures(tmp_path / "closures.csv")


def replay_folder(folder: Path, truth: Trajectory, final: Trajectory, online: Trajectory) -> Path:
    folder.mkdir(exist_ok=True)
    write_tum(folder / "truth.tum", truth.stamps_ns, truth.poses)
    write_tum(folder / "trajectory.tum", final.stamps_ns, final.poses)
    write_tum(folder / "online.tum", online.stamps_ns, online.poses)
    write_closures(folder / "closures.csv", closures_of(truth, ClosureKind.LIDAR, (0.05, 0.05, 0.01)))
    return folder


@given(POSES)
@settings(deadline=None)
def test_ate_and_rpe_of_the_truth_moved_as_one_are_zero(T: tuple[float, float, float]) -> None:
    truth = loops(200)
    estimate = moved(truth, np.array(T))
    alignment = absolute_error(estimate, truth)
    assert alignment.error.ate_max_m < 1e-9
    assert alignment.error.heading_rmse_deg < 1e-9
    assert alignment.error.not_covered == 0
    for error in relative_error(estimate, truth):
        assert error.translation_rmse_m is not None
        assert error.translation_rmse_m < 1e-9


@given(POSES, POSES)
@settings(deadline=None)
def test_ate_does_not_depend_on_the_frame_of_either(
    T: tuple[float, float, float], U: tuple[float, float, float]
) -> None:
    truth = loops(200)
    estimate = noisy(truth, 0.3)
    expected = absolute_error(estimate, truth).error
    error = absolute_error(moved(estimate, np.array(T)), moved(truth, np.array(U))).error
    assert error.ate_rmse_m == pytest.approx(expected.ate_rmse_m, abs=1e-9)
    assert error.heading_rmse_deg == pytest.approx(expected.heading_rmse_deg, abs=1e-6)


@given(POSES, st.lists(st.tuples(st.floats(-100, 100), st.floats(-100, 100)), min_size=2, max_size=20, unique=True))
@settings(deadline=None)
def test_no_small_motion_improves_an_alignment(
    T: tuple[float, float, float], points: list[tuple[float, float]]
) -> None:
    source = np.array(points)
    target = Pose2.of(T).transform(source) + np.random.default_rng(0).normal(0, 0.1, source.shape)
    best = align(source, target)

    def cost(step: Pose2) -> float:
        return float(np.sum((best.transform(step.transform(source)) - target) ** 2))

    for step in (Pose2(1e-3), Pose2(-1e-3), Pose2(0, 1e-3), Pose2(0, -1e-3), Pose2(0, 0, 1e-4), Pose2(0, 0, -1e-4)):
        assert cost(step) >= cost(Pose2()) - 1e-6


def test_what_the_estimate_does_not_cover_is_counted_and_not_scored() -> None:
    truth = loops(200)
    half = Trajectory(truth.stamps_ns[:100], truth.poses[:100])
    assert absolute_error(half, truth).error.not_covered == 99  # 0.5 s beyond the end is allowed
    keep = np.r_[0:50, 120:200]
    gap = Trajectory(truth.stamps_ns[keep], truth.poses[keep])
    assert absolute_error(gap, truth).error.not_covered == 71  # with the pose that ends the gap
    later = Trajectory(truth.stamps_ns + 10**12, truth.poses)
    with pytest.raises(ScoringError, match="share no time"):
        absolute_error(later, truth)


def test_rpe_over_a_distance_grows_with_a_scale_error() -> None:
    truth = loops(400, laps=1.0)
    longer = Trajectory(truth.stamps_ns, truth.poses * [1.02, 1.02, 1.0])
    one, ten, fifty = relative_error(longer, truth)
    assert one.translation_rmse_m == pytest.approx(0.02, abs=0.005)
    assert ten.translation_rmse_m == pytest.approx(0.2, abs=0.06)
    assert (one.heading_rmse_deg, fifty.pairs > 0) == (pytest.approx(0, abs=1e-9), True)
    short = Trajectory(truth.stamps_ns[:20], truth.poses[:20])
    assert relative_error(short, truth)[2].translation_rmse_m is None


@pytest.mark.skipif(not SCORER.exists(), reason="../shared is absent")
@pytest.mark.parametrize("sigma_m", [0.0, 0.2, 3.0])
def test_ate_is_what_the_scorer_says(tmp_path: Path, sigma_m: float) -> None:
    truth = loops()
    estimate = Trajectory(
        truth.stamps_ns[20:-30:3] + 123_456_789, moved(noisy(truth, sigma_m), np.array([5, -9, 2.5])).poses[20:-30:3]
    )
    folder = replay_folder(tmp_path / "replay", truth, estimate, estimate)
    command = [sys.executable, str(SCORER), str(folder / "trajectory.tum"), str(folder / "truth.tum")]
    expected = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    final = evaluate(folder, folder / "truth.tum").to_dict()["final"]
    assert {key: final[key] for key in expected} == pytest.approx(expected, abs=1e-5)


@pytest.mark.skipif(not (SCORER.exists() and REAL_DATA.exists()), reason="../shared/data is absent")
def test_relations_of_a_real_reference_are_what_the_scorer_says() -> None:
    scorer = runpy.run_path(str(SCORER))["relations"]
    path = REAL_DATA / "intel/relations.txt"
    truth, relations = read_tum(REAL_DATA / "intel/truth.tum"), read_relations(path)
    for on_scan_s in (None, 0.002):
        expected = scorer(str(REAL_DATA / "intel/truth.tum"), str(path), on_scan_s)
        error = relation_error(truth, relations, on_scan_s)
        assert {key: getattr(error, key) for key in expected} == pytest.approx(expected, rel=1e-4)


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


def test_an_evaluation_is_written_as_figures_and_pictures(tmp_path: Path) -> None:
    truth = loops()
    folder = replay_folder(tmp_path / "replay", truth, noisy(truth, 0.1), noisy(truth, 0.5, 1))
    (tmp_path / "relations.txt").write_text(f"{START_NS // 10**9} {START_NS // 10**9 + 20}.5 1 2 0.1\n")
    evaluation = evaluate(folder, folder / "truth.tum", tmp_path / "relations.txt")
    write_evaluation(folder, evaluation)
    write_plots(folder, evaluation)
    figures = json.loads((folder / "evaluation.json").read_text())
    assert figures == evaluation.to_dict()
    assert figures["final"]["ate_rmse_m"] < figures["online"]["ate_rmse_m"]
    assert figures["final"]["relations"]["scored"] == 1
    assert [error["distance_m"] for error in figures["final"]["rpe"]] == [1.0, 10.0, 50.0]
    assert figures["closures"]["wifi"]["nees"] is None
    for name in ("evaluation_trajectory.png", "evaluation_error.png"):
        picture = (folder / name).read_bytes()
        assert picture.startswith(b"\x89PNG")
        assert len(picture) < 300_000
        assert min(struct.unpack(">II", picture[16:24])) > 300


def test_what_is_missing_or_broken_is_named(tmp_path: Path) -> None:
    truth = loops(100)
    with pytest.raises(TrajectoryError, match=r"nowhere\.tum"):
        evaluate(tmp_path, tmp_path / "nowhere.tum")
    write_tum(tmp_path / "truth.tum", truth.stamps_ns, truth.poses)
    with pytest.raises(TableError, match=r"closures\.csv"):
        evaluate(tmp_path, tmp_path / "truth.tum")
    write_tum(tmp_path / "one.tum", truth.stamps_ns[:1], truth.poses[:1])
    with pytest.raises(ScoringError, match=r"one\.tum"):
        evaluate(tmp_path, tmp_path / "one.tum")
    (tmp_path / "relations.txt").write_text("1 2 3\n")
    for name in ("relations.txt", "none.txt"):
        with pytest.raises(ScoringError, match=name):
            read_relations(tmp_path / name)
