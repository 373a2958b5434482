"""The rate at which a calibration walks, learnt from turns that are seen: near the truth, whatever noise is claimed."""

import math

import numpy as np
import pytest

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.walk_rate import FACTORS, WalkRate
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2

CONFIG = BackendConfig()
RATES = np.array([CONFIG.walk_turn_scale, CONFIG.walk_turn_bias_rad_per_m, CONFIG.walk_turn_bias_rad_per_s])
STEP_M, STEPS = 0.5, 800  # 400 m
TURN_SCALE, BIAS = 0.05, 0.02  # of the wheels at first, 1 and rad/m


def learnt(rate: float, noise: float = 1.0, slips: float = 0.0) -> float:
    """The median of the rates that drives teach, see `taught`."""
    return float(np.median([taught(rate, seed, noise, slips) for seed in range(5)]))


def taught(rate: float, seed: int, noise: float = 1.0, slips: float = 0.0) -> float:
    """The rate of the turn bias (rad/m per sqrt(m)) that a drive teaches whose wheels walk by `rate`.

    Their turns err at random by `noise` times the claimed sigmas; in a share of `slips` of the steps they slip.
    """
    rng, walk, bias = np.random.default_rng(seed), WalkRate(RATES), BIAS
    for turn in turns(rng):
        bias += rate * math.sqrt(STEP_M) * rng.normal()
        variance = 0.003**2 * STEP_M + 0.02**2 * abs(turn) + 0.002**2
        slip = rng.uniform(0.1, 0.4) if rng.random() < slips else 0.0
        error = TURN_SCALE * turn + bias * STEP_M + noise * math.sqrt(variance) * rng.normal() + slip
        walk.add(WheelMotion(Pose2(STEP_M, 0.0, turn), STEP_M, 1.0), turn + error, variance)
    return walk.factor * CONFIG.walk_turn_bias_rad_per_m


def turns(rng: np.random.Generator) -> Floats:
    """(STEPS,) rad: a corner every five metres, and nearly straight ways."""
    corner = np.arange(STEPS) % 10 == 0
    turned: Floats = np.where(corner, 1.5 * rng.choice([-1.0, 1.0], STEPS), rng.normal(0.0, 0.05, STEPS))
    return turned


@pytest.mark.parametrize("noise", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("rate", [0.0005, 0.001, 0.002])
def test_the_rate_is_learnt_to_a_third(rate: float, noise: float) -> None:
    assert learnt(rate, noise=noise) == pytest.approx(rate, rel=0.33)


@pytest.mark.parametrize("noise", [0.5, 1.0, 2.0])
def test_a_still_bias_is_told_from_one_that_walks(noise: float) -> None:
    assert learnt(0.0, noise=noise) < 0.0004


def test_a_slip_is_no_walk() -> None:
    assert learnt(0.0005, slips=0.01) == pytest.approx(0.0005, rel=0.33)


def test_the_rate_begins_as_configured_and_stays_within_the_grid() -> None:
    assert WalkRate(RATES).factor == 1.0
    assert learnt(0.02) == pytest.approx(FACTORS.max() * CONFIG.walk_turn_bias_rad_per_m, rel=1e-3)


def test_the_same_turns_teach_the_same_rate() -> None:
    assert taught(0.001, 2) == taught(0.001, 2)
