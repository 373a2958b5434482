"""ATE, RPE and relations: laws, and agreement with an independent scorer."""

import json
import math
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from laps import loops, moved, noisy, replay_folder
from places import REAL_DATA, SHARED

from wayfi.backend.pose2 import Pose2
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.evaluate import evaluate, read_relations
from wayfi.service.evaluation.trajectory_scores import (
    ScoringError,
    absolute_error,
    align,
    relation_error,
    relative_error,
)

SCORER = SHARED / "tools" / "score.py"
POSES = st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-math.pi, math.pi))


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
