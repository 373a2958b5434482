"""Wheel odometry: how far it drifts, and where it slips."""

import numpy as np
import pytest
from drives import whole_run

from wayfi.backend.pose2 import Floats, between_all
from wayfi.recordings.simulation import wheels
from wayfi.recordings.simulation.robots.models import Robot
from wayfi.recordings.simulation.run import Run, odometry, start, stream
from wayfi.recordings.simulation.worlds.blueprints import World


def aligned_rmse_m(estimate: Floats, truth: Floats) -> float:
    a, b = estimate[:, :2] - estimate[:, :2].mean(axis=0), truth[:, :2] - truth[:, :2].mean(axis=0)
    u, _, vt = np.linalg.svd(b.T @ a)
    R = u @ np.diag([1.0, np.linalg.det(u @ vt)]) @ vt
    return float(np.sqrt(((a @ R.T - b) ** 2).sum(axis=1).mean()))


def drift_m(world: World, seed: int, minutes: float | None) -> float:
    run = start(world, seed, minutes, robot=Robot.IDEAL)
    return aligned_rmse_m(np.array([m.pose.array() for m in odometry(run)]), run.truth.poses)


@pytest.mark.parametrize("seed", range(8))
def test_odometry_alone_ends_tens_of_metres_off(seed: int) -> None:
    assert 30.0 < drift_m(World.CARPARK, seed, None) < 75.0


@pytest.mark.parametrize("seed", range(4))
def test_odometry_drifts_within_five_minutes(seed: int) -> None:
    assert 0.4 < drift_m(World.CARPARK, seed, 5.0) < 6.0


def test_perfect_wheels_have_small_random_errors_only() -> None:
    truth = start(World.OFFICE, 0, minutes=1.0).truth.poses
    perfect, hold = wheels.WheelErrors(1.0, 1.0, 0.0, 0.0), wheels.no_slips(len(truth) - 1)
    measured = wheels.odometry(truth, 0.1, perfect, hold, np.random.default_rng(0))
    assert 0.0 < aligned_rmse_m(measured, truth) < 0.2


def motions(run: Run, steps: wheels.StepErrors) -> Floats:
    poses = wheels.odometry(run.truth.poses, 0.1, run.wheels, steps, stream(run.seed, "odometry"))
    return between_all(poses[:-1], poses[1:])


@pytest.mark.parametrize("seed", range(6))
def test_wheels_slip_a_few_times_a_drive(seed: int) -> None:
    run = whole_run(World.CARPARK, seed)
    truth = run.truth.poses
    slips, none = wheels.draw_slips(truth, stream(seed, "slips")), wheels.no_slips(len(truth) - 1)
    slipping, holding = motions(run, slips), motions(run, none)
    jumps = np.abs(slipping[:, 2] - holding[:, 2])
    assert 0 <= (jumps > 1e-9).sum() <= 12
    assert np.all((jumps < 1e-9) | ((jumps > 0.1) & (jumps < 0.45)))
    distance, held = (np.hypot(motion[:, 0], motion[:, 1]) for motion in (slipping, holding))
    spins = np.flatnonzero(np.abs(distance - held) > 1e-3 * held + 1e-9)
    assert 1 <= (np.diff(spins) > 1).sum() + 1 <= 16
    assert held[spins].sum() < 25.0


def test_slips_lengthen_the_way_and_turn_it_to_either_side() -> None:
    truth = whole_run(World.CARPARK, seed=3).truth.poses
    slips = [wheels.draw_slips(truth, stream(seed, "slips")) for seed in range(20)]
    turns = np.concatenate([s.turn_rad[s.turn_rad != 0] for s in slips])
    scales = np.concatenate([s.distance_scale[s.distance_scale != 1] for s in slips])
    assert 20 < len(turns) < 160
    assert 0.1 <= np.abs(turns).min() < np.abs(turns).max() <= 0.45
    assert 0.3 < (turns > 0).mean() < 0.7
    assert 1.1 <= scales.min() < scales.max() <= 1.3


def test_wheels_slip_rather_in_turns_and_never_at_rest() -> None:
    truth = whole_run(World.CARPARK, seed=3).truth.poses
    motion = between_all(truth[:-1], truth[1:])
    slips = np.any([wheels.draw_slips(truth, stream(seed, "slips")).turn_rad != 0 for seed in range(20)], axis=0)
    turning, at_rest = np.abs(motion[:, 2]) > 0.02, np.abs(motion[:, [0, 2]]).max(axis=1) < 1e-9
    assert slips[turning].mean() > 4 * slips[~turning & ~at_rest].mean()
    assert not slips[at_rest].any()
