"""The search of a window of poses, against brute force over the same lattice and against known rooms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rooms import HALL, TWO_FOLD, see

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.lidar.correlative import (
    BRANCH,
    CorrelativeConfig,
    LikelihoodField,
    SearchWindow,
    build_field,
    mean_values,
    search,
)

CONFIG = CorrelativeConfig()


def box(xy_m: float, theta_rad: float) -> SearchWindow:
    """The whole of a window, no ellipse."""
    return SearchWindow(xy_m, theta_rad, np.zeros((3, 3)), 1.0)


def cells_of(points: Floats, field: LikelihoodField, pose: Pose2) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    return np.floor((pose.transform(points) - field.origin) / field.cell_m).astype(np.int64)


def plain_score(points: Floats, field: LikelihoodField, pose: Pose2, shift: tuple[int, int] = (0, 0)) -> float:
    """The mean of the field under the points of `pose`, moved by `shift` cells; 0 beyond the field."""
    cells = cells_of(points, field, pose) + np.array(shift)
    inside = ((cells >= 0) & (cells < field.fine.shape)).all(axis=1)
    return float(field.fine[tuple(cells[inside].T)].sum(dtype=np.float64) / len(points))


@pytest.mark.parametrize("seed", range(8))
def test_the_pose_is_found_in_the_window(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a = Pose2(rng.uniform(-1, 1), rng.uniform(-2, 1), rng.uniform(-3, 3))
    T_a_b = Pose2(*rng.uniform(-1.4, 1.4, 2), rng.uniform(-0.4, 0.4))
    field = build_field(see(HALL, a, rng).points, CONFIG)
    peak = search(see(HALL, a @ T_a_b, rng).points, field, Pose2(), box(1.5, 0.5), CONFIG)
    assert peak.pose.distance(T_a_b) < 1.5 * CONFIG.cell_m
    assert abs(wrap(peak.pose.theta - T_a_b.theta)) < 2 * CONFIG.angle_step
    assert 0.5 < peak.score <= 1.0
    assert peak.second_score < 0.92 * peak.score


def test_a_room_that_looks_alike_from_both_ends_has_a_second_peak_as_high_as_the_first() -> None:
    rng = np.random.default_rng(1)
    plain, furnished = TWO_FOLD[:4], HALL
    ratios = []
    for faces in (plain, furnished):
        scans = [see(faces, Pose2(0.0, 0.0, heading), rng).points for heading in (0.0, math.pi)]
        submap = np.concatenate([scans[0], -scans[1]])
        peak = search(
            see(faces, Pose2(0.3, 0.2, 0.1), rng).points, build_field(submap, CONFIG), Pose2(), box(1.0, 3.3), CONFIG
        )
        ratios.append(peak.second_score / peak.score)
    assert ratios[0] > 0.95
    assert ratios[1] < 0.92


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**31), st.integers(-40, 40), st.integers(-40, 40))
def test_a_coarse_cells_score_bounds_every_pose_in_it(seed: int, dr: int, dc: int) -> None:
    rng = np.random.default_rng(seed)
    field = build_field(rng.uniform(-1.5, 1.5, (30, 2)), CONFIG)
    pose = Pose2(*rng.uniform(-3, 3, 3))
    cells = cells_of(rng.uniform(-2, 2, (20, 2)), field, pose)
    (bound,) = mean_values(cells, field.coarse, dr, np.array([dc]), BRANCH - 1)
    scores = [mean_values(cells, field.fine, dr + i, dc + np.arange(BRANCH), 0) for i in range(BRANCH)]
    assert np.max(scores) <= bound + 1e-6


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**31), st.integers(-30, 30), st.integers(-30, 30))
def test_a_score_is_the_mean_of_the_field_under_the_points(seed: int, dr: int, dc: int) -> None:
    rng = np.random.default_rng(seed)
    field = build_field(rng.uniform(-1.5, 1.5, (30, 2)), CONFIG)
    points, pose = rng.uniform(-2, 2, (20, 2)), Pose2(*rng.uniform(-3, 3, 3))
    (score,) = mean_values(cells_of(points, field, pose), field.fine, dr, np.array([dc]), 0)
    assert math.isclose(score, plain_score(points, field, pose, (dr, dc)), abs_tol=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_the_best_of_the_window_is_the_best_of_its_whole_lattice(seed: int) -> None:
    rng = np.random.default_rng(seed)
    config = CorrelativeConfig(max_coarse_cells=10**6, angle_step=0.05)
    field = build_field(rng.uniform(-2, 2, (40, 2)), config)
    points, guess = rng.uniform(-2, 2, (25, 2)), Pose2(*rng.uniform(-0.5, 0.5, 3))
    peak = search(points, field, guess, box(0.8, 0.2), config)
    best = max(
        plain_score(points, field, Pose2(guess.x, guess.y, guess.theta + a * 0.05), (i, j))
        for a in range(-4, 5)
        for i in range(-8, 8 + BRANCH)
        for j in range(-8, 8 + BRANCH)
    )
    assert math.isclose(peak.score, best, abs_tol=1e-6)
    assert math.isclose(peak.score, plain_score(points, field, peak.pose), abs_tol=0.02)
    assert peak.second_score <= peak.score


def test_the_field_is_one_at_its_points_and_fades_within_the_blur() -> None:
    points = np.array([[0.05, 0.05], [3.05, 1.05]])
    field = build_field(points, CONFIG)
    cells = cells_of(points, field, Pose2())
    assert (field.fine[tuple(cells.T)] == 1.0).all()
    assert field.fine.max() == 1.0
    row, column = cells[0]
    beside = [float(field.fine[row, column + k]) for k in range(6)]
    expected = [math.exp(-0.5 * (0.1 * k / CONFIG.blur_m) ** 2) for k in range(5)] + [0.0]
    np.testing.assert_allclose(beside, expected, atol=1e-6)


def test_a_search_stays_in_its_window_and_ends_by_its_bound() -> None:
    rng = np.random.default_rng(9)
    field = build_field(see(HALL, Pose2(), rng).points, CONFIG)
    guess = Pose2(2.0, 1.0, 0.5)
    peak = search(
        see(HALL, Pose2(-2.0, 0.0, 0.0), rng).points, field, guess, box(0.5, 0.2), CorrelativeConfig(max_coarse_cells=5)
    )
    margin = 0.5 + BRANCH * CONFIG.cell_m
    assert abs(peak.pose.x - guess.x) <= margin
    assert abs(peak.pose.y - guess.y) <= margin
    assert abs(peak.pose.theta - guess.theta) <= 0.2 + CONFIG.angle_step


def test_beyond_the_submap_nothing_scores() -> None:
    rng = np.random.default_rng(10)
    field = build_field(see(HALL, Pose2(), rng).points, CONFIG)
    peak = search(see(HALL, Pose2(), rng).points, field, Pose2(500.0, 500.0, 0.0), box(0.5, 0.1), CONFIG)
    assert peak.score == peak.second_score == 0.0
    assert peak.pose.distance(Pose2(500.0, 500.0, 0.0)) < 1e-9
    assert abs(peak.pose.theta) < 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_an_ellipse_holds_the_best_of_the_poses_within_its_chi2(seed: int) -> None:
    rng = np.random.default_rng(seed)
    config = CorrelativeConfig(max_coarse_cells=10**6, angle_step=0.05)
    field = build_field(rng.uniform(-2, 2, (40, 2)), config)
    points, guess = rng.uniform(-2, 2, (25, 2)), Pose2(*rng.uniform(-0.5, 0.5, 3))
    covariance = np.array([[0.1, 0.06, 0.0], [0.06, 0.1, 0.01], [0.0, 0.01, 0.01]])
    window = SearchWindow(0.8, 0.2, np.linalg.inv(covariance), 4.0)
    peak = search(points, field, guess, window, config)
    best = max(
        plain_score(points, field, Pose2(guess.x, guess.y, guess.theta + a * 0.05), (i, j))
        for a in range(-4, 5)
        for i in range(-8, 8 + BRANCH)
        for j in range(-8, 8 + BRANCH)
        if (e := np.array([i * config.cell_m, j * config.cell_m, a * 0.05])) @ window.information @ e <= window.chi2
    )
    assert math.isclose(peak.score, best, abs_tol=1e-6)


def test_a_window_holds_the_ellipse_of_its_covariance_within_its_bounds() -> None:
    covariance = np.diag([0.09, 0.04, 0.0025])
    window = SearchWindow.of(covariance, 9.0, (0.1, 0.1), (4.0, 0.5))
    assert (window.xy_m, window.theta_rad) == pytest.approx((0.9, 0.15))
    bounded = SearchWindow.of(100 * covariance, 9.0, (0.1, 0.1), (4.0, 0.5))
    assert (bounded.xy_m, bounded.theta_rad) == (4.0, 0.5)
