"""A building's axes by the wheels alone: found along corridors, kept through wings, and not where there are none."""

import math

import numpy as np
import pytest

from wayfi.backend.graph.wheel_calibration import WheelCalibration, WheelMotion
from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.axes.building_axes import AlongAxis, BuildingAxes
from wayfi.frontends.odometry.odometry_config import AxesConfig

PRIOR = WheelCalibration(np.zeros(4), np.array([0.035, 0.03, 0.06, 0.0005]))
STEP_M = 0.5
VARIANCE = 0.003**2


def drive(turns: Floats, bias: float, scale: float = 0.0, start: float = 0.0) -> tuple[BuildingAxes, list[AlongAxis]]:
    """The filter after steps of half a metre with these true `turns` (n,), by wheels that err, and what it settled."""
    axes = BuildingAxes(start, PRIOR, AxesConfig())
    settled = []
    for turn in turns:
        said = (turn - bias * STEP_M) / (1 + scale)
        axes.add(WheelMotion(Pose2(STEP_M, 0.0, said), STEP_M, 1.0), VARIANCE)
        settled += axes.settled()
    return axes, settled


def corridors(*lengths_m: float, corner: float = math.pi / 2, seed: int = 0) -> Floats:
    """True turns along corridors, `corner` rad between them, weaving by some degrees."""
    straight = [np.zeros(int(m / STEP_M)) for m in lengths_m]
    turns = np.concatenate([np.concatenate([s, np.full(3, corner / 3)]) for s in straight])
    heading = np.random.default_rng(seed).normal(0, 0.03, len(turns) + 1)
    weaving: Floats = turns + np.diff(heading)
    return weaving


@pytest.mark.parametrize("bias", [-0.05, -0.02, 0.0, 0.025, 0.05])
def test_two_corridors_tell_the_wheels_bias_and_every_heading(bias: float) -> None:
    turns = corridors(40, 30, 30)
    axes, settled = drive(turns, bias, scale=0.02, start=0.7)
    assert axes.calibration[1] == pytest.approx(bias, abs=0.004)
    headings = np.cumsum(turns)
    assert len(settled) > 25
    assert {along.wing for along in settled} == {1}
    off = np.array([wrap(along.turned - headings[along.step - 1]) for along in settled])
    assert np.abs(off - np.median(off)).max() < 0.2


def test_wings_at_an_angle_are_told_apart() -> None:
    _, settled = drive(corridors(60, 40, 40, corner=0.6), 0.01)
    assert {along.wing for along in settled} == {1, 2, 3}


@pytest.mark.parametrize("seed", range(5))
def test_a_robot_that_wanders_shows_no_axes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    curvature = np.repeat(rng.uniform(-0.4, 0.4, 100), 6)
    _, settled = drive(curvature * STEP_M, 0.0)
    assert len(settled) < 0.05 * len(curvature) * STEP_M / 2


def test_nothing_is_settled_before_there_is_evidence() -> None:
    axes, settled = drive(corridors(9.0), 0.0)
    assert axes.evidence < AxesConfig().min_evidence
    assert settled == []


@pytest.mark.parametrize("slip", [0.4, -0.4])
def test_after_a_slip_the_wheels_are_in_doubt_at_its_place_alone(slip: float) -> None:
    turns = corridors(60, 40, 40)
    slipped_at = 110
    turns[slipped_at] += slip
    _, settled = drive(turns, 0.01)
    doubtful = [along for along in settled if along.slipped]
    assert len(doubtful) == 1
    assert doubtful[0].doubtful_from <= slipped_at < doubtful[0].step
    assert doubtful[0].slipped == pytest.approx(abs(slip), abs=0.15)


def test_wheels_that_slip_nowhere_are_not_doubted() -> None:
    _, settled = drive(corridors(60, 40, 40), 0.02, scale=0.03)
    assert not any(along.slipped for along in settled)
