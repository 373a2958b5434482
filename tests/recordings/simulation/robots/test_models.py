"""What the three robots draw: within the ranges of real ones, and over many seeds all over them."""

import numpy as np
import pytest

from wayfi.recordings.simulation.laser import UST_20LX, LaserSpec
from wayfi.recordings.simulation.robots.lasers import draw_laser
from wayfi.recordings.simulation.robots.models import MODELS, Robot
from wayfi.recordings.simulation.robots.mounting import draw_mount
from wayfi.recordings.simulation.run import T_BASE_LASER, start
from wayfi.recordings.simulation.wheels import WheelErrors, draw_wheels
from wayfi.recordings.simulation.worlds.blueprints import World

MANY = 400


def wheels_of(robot: Robot) -> list[WheelErrors]:
    return [draw_wheels(MODELS[robot].wheels, np.random.default_rng(seed)) for seed in range(MANY)]


def lasers_of(robot: Robot) -> list[LaserSpec]:
    ranges = MODELS[robot].laser
    assert ranges is not None
    return [draw_laser(UST_20LX, ranges, np.random.default_rng(seed)) for seed in range(MANY)]


@pytest.mark.parametrize(("robot", "bias_rad_per_m"), [(Robot.TYPICAL, 0.02), (Robot.CHEAP, 0.06)], ids=str)
def test_wheels_err_as_far_as_real_ones_to_either_side(robot: Robot, bias_rad_per_m: float) -> None:
    drawn = wheels_of(robot)
    for errors, most in (
        (np.array([w.distance_scale - 1 for w in drawn]), 0.035),
        (np.array([w.turn_scale - 1 for w in drawn]), 0.1),
        (np.array([w.bias_rad_per_m for w in drawn]), bias_rad_per_m),
    ):
        assert 0.9 * most < errors.max() <= most
        assert -most <= errors.min() < -0.9 * most
    assert 0.02 < np.mean([abs(w.turn_scale - 1) > 0.05 for w in drawn]) < 0.3


def test_the_bias_wanders_as_gyroscopes_do_and_that_of_an_ideal_robot_stays() -> None:
    walks = [w.bias_walk for robot in (Robot.TYPICAL, Robot.CHEAP) for w in wheels_of(robot)]
    assert 3e-5 <= min(walks) < 4e-5
    assert 1.1e-4 < max(walks) <= 1.2e-4
    assert {w.bias_walk for w in wheels_of(Robot.IDEAL)} == {0.0}


def test_cheap_lasers_are_coarse_and_slow() -> None:
    drawn = lasers_of(Robot.CHEAP)
    rates = [1e9 / spec.period_ns for spec in drawn]
    assert 1.99 < min(rates) < 2.2
    assert 6.5 < max(rates) < 7.1
    for spec in drawn:
        assert (spec.beams, spec.resolution_m, spec.mixed_share) == (271, 0.01, 0.5)
        assert spec.bearings[-1] == pytest.approx(UST_20LX.bearings[-1], abs=1e-9)
        assert spec.sweep_s < spec.period_ns * 1e-9


def test_a_typical_laser_is_as_fast_and_fine_as_the_worlds() -> None:
    for spec in lasers_of(Robot.TYPICAL):
        assert (spec.beams, spec.period_ns, spec.resolution_m) == (1081, 100_000_000, 0.001)
        assert 0.15 <= spec.mixed_share <= 0.5


def test_lasers_are_mounted_off_the_middle_and_look_every_way() -> None:
    mounts = np.array([draw_mount(np.random.default_rng(seed)).array() for seed in range(MANY)])
    assert np.hypot(mounts[:, 0], mounts[:, 1]).max() < 0.3
    assert (np.abs(mounts[:, 2]) > 2.9).mean() > 0.15
    assert (np.abs(mounts[:, 2]) < 0.16).mean() > 0.15


def test_about_half_of_the_robots_stamp_scans_like_odometry_but_no_ideal_one_does() -> None:
    delays = [start(World.OFFICE, seed, 0.1).scan_delay_ns for seed in range(12)]
    assert 3 <= delays.count(0) <= 9
    ideal = [start(World.OFFICE, seed, 0.1, Robot.IDEAL) for seed in range(12)]
    assert {(run.scan_delay_ns, run.T_base_laser) for run in ideal} == {(30_000_000, T_BASE_LASER)}
