"""Evidence for a turn bias: found among false pairs, weighed against chance, and none where there is none."""

from dataclasses import replace

import numpy as np
import pytest

from wayfi.backend.graph.wheel_calibration import WheelCalibration, chain, corrected_all
from wayfi.backend.pose2 import Floats
from wayfi.frontends.closures.closure_config import ConsensusConfig
from wayfi.frontends.closures.consensus import (
    Headings,
    Pairs,
    best_hypothesis,
    driven_area,
    likelihood_ratio,
    weigh,
)
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior

PRIOR = calibration_prior(OdometryConfig())
CONFIG = ConsensusConfig()
STEP_M, ROUND = 0.5, 120
BY_WHEELS = np.full((3 * ROUND, 3), np.nan)  # no step is known from a scan match

NO_AXES = Headings(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))


def axes(every: int = 4) -> Headings:
    """The headings of the first round along its rectangle, in two wings of unknown directions."""
    k = np.array([k for k in range(2, ROUND, every) if k % 20 > 1])
    turned = np.pi / 2 * ((k > 40).astype(float) + (k > 60) + (k > 100))
    return Headings(k, (k > 60).astype(np.int64), turned, np.full(len(k), 0.1))


def motions(bias: float, rounds: int = 3) -> Floats:
    """(n, 5) what wheels say that turn by themselves by `bias`, on rounds of a rectangle of 20 x 10 m."""
    corner = np.isin(np.arange(rounds * ROUND) % ROUND, (40, 60, 100, 0))
    rows = np.zeros((rounds * ROUND, 5))
    rows[:, 0], rows[:, 3], rows[:, 4] = STEP_M, STEP_M, 1.0
    rows[:, 2] = np.where(corner, np.pi / 2, 0.0) - bias * STEP_M
    return rows


def pairs(a: list[int], b: list[int], sigma_m: float = 1.0, weight: float = 1.0) -> Pairs:
    n = len(a)
    keyframes_a, keyframes_b = np.array(a), np.array(b)
    return Pairs(
        keyframes_a, keyframes_b, np.zeros((n, 2)), np.zeros((n, 2)), np.full(n, sigma_m),
        STEP_M * (keyframes_b - keyframes_a), np.full(n, weight),
    )  # fmt: skip


def rounds(every: int = 10) -> tuple[list[int], list[int]]:
    b = list(range(ROUND + 5, 3 * ROUND, every))
    return [k - ROUND for k in b], b


@pytest.mark.parametrize("bias", [-0.07, -0.02, 0.0, 0.025, 0.1])
def test_the_bias_that_makes_the_pairs_meet_is_found(bias: float) -> None:
    found = best_hypothesis(motions(bias), BY_WHEELS, pairs(*rounds()), NO_AXES, PRIOR, CONFIG)
    assert found.values[2] == pytest.approx(bias, abs=0.002)
    assert found.explained.all()
    assert found.evidence > 3 * CONFIG.min_gain


@pytest.mark.parametrize("seed", range(4))
def test_it_is_found_among_nine_false_pairs_for_each_true_one(seed: int) -> None:
    a, b = rounds()
    rng = np.random.default_rng(seed)
    false_b = rng.integers(80, 3 * ROUND, 9 * len(b))
    false_a = (rng.random(len(false_b)) * (false_b - 60)).astype(int)
    mixed = pairs([*a, *false_a.tolist()], [*b, *false_b.tolist()])
    found = best_hypothesis(motions(0.04), BY_WHEELS, mixed, NO_AXES, PRIOR, CONFIG)
    assert found.values[2] == pytest.approx(0.04, abs=0.002)
    assert found.explained[: len(a)].mean() > 0.9
    assert found.evidence > CONFIG.min_gain


def test_chance_alone_gives_hardly_any_evidence() -> None:
    rng = np.random.default_rng(0)
    evidence = []
    for _ in range(10):
        b = rng.integers(80, 3 * ROUND, 30)
        a = (rng.random(30) * (b - 60)).astype(int)
        chance = pairs(a.tolist(), b.tolist())
        evidence.append(best_hypothesis(motions(0.0), BY_WHEELS, chance, NO_AXES, PRIOR, CONFIG).evidence)
    assert np.median(evidence) < CONFIG.min_gain
    assert min(evidence) >= 0.0, "that all is chance is among the hypotheses"


def test_a_spiral_that_brings_everything_together_explains_nothing() -> None:
    """A bias under which the whole drive winds up within a few metres makes any pair meet, and so no pair tells."""
    a, b = rounds()
    wound = chain(corrected_all(motions(0.0), np.array([0.0, 0.0, 2.0, 0.0])))
    right = chain(corrected_all(motions(0.0), np.zeros(4)))
    assert driven_area(wound) < 0.05 * driven_area(right)
    assert weigh(wound, pairs(a, b), CONFIG.drift)[0] < 0.2 * weigh(right, pairs(a, b), CONFIG.drift)[0]


def test_half_the_weight_is_half_the_evidence() -> None:
    a, b = rounds()
    poses = chain(corrected_all(motions(0.0), np.zeros(4)))
    whole, half = (weigh(poses, pairs(a, b, weight=w), CONFIG.drift)[0] for w in (1.0, 0.5))
    assert half == pytest.approx(whole / 2)


def test_where_scan_matches_give_the_steps_no_bias_is_better_than_another() -> None:
    right = corrected_all(motions(0.0), np.zeros(4))
    found = best_hypothesis(motions(0.05), right, pairs(*rounds()), NO_AXES, PRIOR, CONFIG)
    np.testing.assert_allclose(found.poses, chain(right), atol=1e-9)
    assert found.values[2] == pytest.approx(0.0, abs=1e-9)
    assert found.explained.all()


def test_a_known_calibration_is_kept_to() -> None:
    known = WheelCalibration(np.array([0.0, 0.0, 0.03, 0.0]), replace(PRIOR).sigmas * (1, 1, 0.01, 1))
    found = best_hypothesis(motions(0.0), BY_WHEELS, pairs(*rounds()), NO_AXES, known, CONFIG)
    assert abs(found.values[2] - 0.03) <= 4 * known.sigmas[2] + 1e-12


def test_the_area_is_that_of_the_ellipse_driven() -> None:
    angle = np.linspace(0, 2 * np.pi, 400)
    disk = np.array(
        [[r * np.cos(t), r * np.sin(t), 0.0] for r in np.sqrt(np.linspace(0.01, 1, 60)) * 10 for t in angle]
    )
    assert driven_area(disk) == pytest.approx(np.pi * 100, rel=0.1)
    straight = np.stack([np.linspace(0, 100, 200), np.zeros(200), np.zeros(200)], axis=1)
    assert 100 < driven_area(straight) < 1000


def test_the_ratio_is_that_of_a_gauss_bell_to_an_even_spread() -> None:
    rng = np.random.default_rng(1)
    side, sigma = 20.0, 2.0
    near = rng.normal(0, sigma, (200_000, 2))
    chi2 = (near**2).sum(axis=1) / sigma**2
    ratio = likelihood_ratio(chi2, np.full(len(chi2), sigma**2), side**2)
    assert np.mean(1 / ratio[chi2 < 9]) == pytest.approx(np.pi * 9 * sigma**2 / side**2 / (1 - np.exp(-4.5)), rel=0.02)


def test_the_axes_of_the_building_speak_for_the_right_bias_and_against_another() -> None:
    right, wrong = (chain(corrected_all(motions(0.0, 1), np.array([0, 0, bias, 0]))) for bias in (0.0, 0.02))
    assert axes().evidence(right[:, 2]) > 2 * len(axes().keyframe)
    assert axes().evidence(wrong[:, 2]) < axes().evidence(right[:, 2]) - 4 * CONFIG.min_gain


def test_headings_that_are_all_wrong_cost_no_more_than_their_share() -> None:
    headings = axes()
    chance = chain(corrected_all(motions(0.0, 1), np.array([0, 0, 0.15, 0])))
    assert headings.evidence(chance[:, 2]) > np.log(0.1) * len(headings.keyframe)
