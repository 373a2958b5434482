"""Simulated recordings: what they promise about their bytes, the drive and the wheels."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from wayfi.backend.pose2 import between_all
from wayfi.frontends.measurements import LaserScan, Odometry, StaticTransforms, WifiScan
from wayfi.recordings.simulation import wheels
from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.run import Run, measurements, odometry, start, stream, wifi_scans
from wayfi.recordings.simulation.worlds import BLUEPRINTS, World
from wayfi.service.cli.app import app

Floats = NDArray[np.float64]

FULL_RUNS = {world: start(world, seed=3) for world in World}


@pytest.fixture(params=list(World), ids=str)
def world(request: pytest.FixtureRequest) -> World:
    return World(request.param)


@pytest.fixture
def run(world: World) -> Run:
    return FULL_RUNS[world]


def distances_m(point: Floats, ends: Floats) -> Floats:
    """(n,) from `point` (2,) to each of the faces (n, 4)."""
    start_xy, along = ends[:, :2], ends[:, 2:] - ends[:, :2]
    fraction = np.clip(((point - start_xy) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.asarray(np.hypot(*(start_xy + fraction[:, None] * along - point).T))


def aligned_rmse_m(estimate: Floats, truth: Floats) -> float:
    a, b = estimate[:, :2] - estimate[:, :2].mean(axis=0), truth[:, :2] - truth[:, :2].mean(axis=0)
    u, _, vt = np.linalg.svd(b.T @ a)
    R = u @ np.diag([1.0, np.linalg.det(u @ vt)]) @ vt
    return float(np.sqrt(((a @ R.T - b) ** 2).sum(axis=1).mean()))


def drift_m(world: World, seed: int, minutes: float | None) -> float:
    run = start(world, seed, minutes, rough=False)
    return aligned_rmse_m(np.array([m.pose.array() for m in odometry(run)]), run.truth.poses)


# The recording


@pytest.mark.parametrize("rough", [True, False])
def test_same_arguments_same_bytes(tmp_path: Path, rough: bool) -> None:
    first, again = (simulate(World.CARPARK, tmp_path / name, seed=7, minutes=0.2, rough=rough) for name in "ab")
    assert first.recording.read_bytes() == again.recording.read_bytes()
    assert first.truth.read_bytes() == again.truth.read_bytes()


def test_another_seed_is_another_recording(tmp_path: Path) -> None:
    first, other = (simulate(World.CARPARK, tmp_path / str(seed), seed, minutes=0.05) for seed in (1, 2))
    assert first.recording.read_bytes() != other.recording.read_bytes()


@pytest.mark.parametrize(("options", "rough"), [([], True), (["--rough"], True), (["--ideal"], False)], ids=str)
def test_the_command_is_rough_unless_told_otherwise(tmp_path: Path, options: list[str], rough: bool) -> None:
    arguments = ["simulate", "campus", "--minutes", "0.1", "--quiet", "--out", str(tmp_path / "cli"), *options]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    made = simulate(World.CAMPUS, tmp_path / "made", minutes=0.1, rough=rough)
    assert (tmp_path / "cli" / "recording.mcap").read_bytes() == made.recording.read_bytes()


def test_rough_and_ideal_differ(tmp_path: Path) -> None:
    rough, ideal = (simulate(World.OFFICE, tmp_path / str(r), minutes=0.05, rough=r) for r in (True, False))
    assert rough.recording.read_bytes() != ideal.recording.read_bytes()


def test_what_is_rough_changes_neither_the_truth_nor_the_wifi(world: World) -> None:
    rough, ideal = (start(world, 4, minutes=0.5, rough=rough) for rough in (True, False))
    np.testing.assert_array_equal(rough.truth.poses, ideal.truth.poses)
    for a, b in zip(wifi_scans(rough), wifi_scans(ideal), strict=True):
        assert a.bssids == b.bssids
        np.testing.assert_array_equal(a.rssi, b.rssi)


def test_progress_rises_to_one(tmp_path: Path) -> None:
    fractions: list[float] = []
    simulate(World.OFFICE, tmp_path, minutes=0.1, progress=fractions.append)
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


def test_a_cut_drive_is_the_beginning_of_the_whole(world: World) -> None:
    cut, longer = (measurements(start(world, 5, minutes)) for minutes in (0.1, 0.2))
    for a, b in zip(cut, longer, strict=False):
        assert (type(a), a.stamp_ns) == (type(b), b.stamp_ns)
        if isinstance(a, LaserScan) and isinstance(b, LaserScan):
            np.testing.assert_array_equal(a.ranges, b.ranges)
        if isinstance(a, Odometry) and isinstance(b, Odometry):
            assert a.pose == b.pose
        if isinstance(a, WifiScan) and isinstance(b, WifiScan):
            assert a.bssids == b.bssids


def test_rates_and_order() -> None:
    received = list(measurements(start(World.CARPARK, 0, minutes=1.0)))
    stamps = [m.stamp_ns for m in received]
    assert stamps == sorted(stamps)
    assert isinstance(received[0], StaticTransforms)
    assert sum(isinstance(m, Odometry) for m in received) == 601
    assert sum(isinstance(m, LaserScan) for m in received) == 600
    for phone in ("phone_a", "phone_b"):
        assert sum(isinstance(m, WifiScan) and m.receiver == phone for m in received) == 30


# The drive


def test_length_and_duration_are_those_of_the_paper() -> None:
    run = FULL_RUNS[World.CARPARK]
    assert run.length_ns / 1e9 == pytest.approx(2580.0, abs=1.0)
    assert run.truth.path_m()[-1] == pytest.approx(1070.0, abs=1.0)


def test_every_drive_is_as_long_as_planned(world: World) -> None:
    run, plan = FULL_RUNS[world], BLUEPRINTS[world].route
    assert run.length_ns / 1e9 == pytest.approx(plan.duration_s, abs=1.0)
    assert run.truth.path_m()[-1] == pytest.approx(plan.length_m, abs=1.0)


def test_starts_at_rest_at_the_origin(run: Run) -> None:
    np.testing.assert_allclose(run.truth.poses[:10], 0.0, atol=1e-3)


def test_speeds_turns_and_accelerations_are_a_robots(world: World, run: Run) -> None:
    cruise_m_s = BLUEPRINTS[world].route.cruise_m_s
    motion = between_all(run.truth.poses[:-1], run.truth.poses[1:]) / 0.1
    assert motion[:, 0].min() >= 0.0
    assert 0.9 * cruise_m_s < motion[:, 0].max() < 1.2 * cruise_m_s
    assert np.abs(motion[:, 1]).max() < 0.02
    assert np.abs(motion[:, 2]).max() < 0.65
    assert np.abs(np.diff(motion[:, 0])).max() / 0.1 < 0.9


def test_keeps_away_from_everything(run: Run) -> None:
    nearest = []
    for since_s in np.arange(0.0, run.length_ns / 1e9, 20.0):
        times_s = np.arange(since_s, since_s + 20.0, 0.7)
        poses = run.drive.poses(times_s)
        near = run.surfaces.around(poses[:, :2], 5.0, times_s[0], times_s[-1])
        nearest += [distances_m(pose[:2], near.at(t)).min() for t, pose in zip(times_s, poses, strict=True)]
    assert min(nearest) > 0.25


def test_five_minutes_revisit_a_place() -> None:
    for seed in range(4):
        poses = start(World.CARPARK, seed, minutes=5.0).truth.poses
        early, late = poses[:900:5], poses[2400:2700:5]
        gaps = np.hypot(*(early[:, None, :2] - late[None, :, :2]).transpose(2, 0, 1))
        assert (gaps.min(axis=0) < 1.0).mean() > 0.9


# The wheels


@pytest.mark.parametrize("seed", range(8))
def test_odometry_alone_ends_tens_of_metres_off(seed: int) -> None:
    assert 30.0 < drift_m(World.CARPARK, seed, None) < 75.0


@pytest.mark.parametrize("seed", range(4))
def test_odometry_drifts_within_five_minutes(seed: int) -> None:
    assert 0.4 < drift_m(World.CARPARK, seed, 5.0) < 6.0


def test_perfect_wheels_have_small_random_errors_only() -> None:
    truth = start(World.OFFICE, 0, minutes=1.0).truth.poses
    perfect, hold = wheels.Wheels(1.0, 1.0, 0.0, 0.0), wheels.no_slips(len(truth) - 1)
    reported = wheels.odometry(truth, 0.1, perfect, hold, np.random.default_rng(0))
    assert 0.0 < aligned_rmse_m(reported, truth) < 0.2


def reported_motion(run: Run) -> Floats:
    poses = np.array([m.pose.array() for m in odometry(run)])
    return between_all(poses[:-1], poses[1:])


@pytest.mark.parametrize("seed", range(6))
def test_wheels_slip_a_few_times_a_drive(seed: int) -> None:
    rough, ideal = (reported_motion(start(World.CARPARK, seed, rough=rough)) for rough in (True, False))
    jumps = np.abs(rough[:, 2] - ideal[:, 2])
    assert 0 <= (jumps > 1e-9).sum() <= 12
    assert np.all((jumps < 1e-9) | ((jumps > 0.1) & (jumps < 0.45)))
    distance, held = (np.hypot(motion[:, 0], motion[:, 1]) for motion in (rough, ideal))
    spins = np.flatnonzero(np.abs(distance - held) > 1e-3 * held + 1e-9)
    assert 1 <= (np.diff(spins) > 1).sum() + 1 <= 16
    assert held[spins].sum() < 25.0


def test_slips_lengthen_the_way_and_turn_it_to_either_side() -> None:
    truth = FULL_RUNS[World.CARPARK].truth.poses
    slips = [wheels.draw_slips(truth, stream(seed, "slips")) for seed in range(20)]
    turns = np.concatenate([s.turn_rad[s.turn_rad != 0] for s in slips])
    scales = np.concatenate([s.distance_scale[s.distance_scale != 1] for s in slips])
    assert 20 < len(turns) < 160
    assert 0.1 <= np.abs(turns).min() < np.abs(turns).max() <= 0.45
    assert 0.3 < (turns > 0).mean() < 0.7
    assert 1.1 <= scales.min() < scales.max() <= 1.3


def test_wheels_slip_rather_in_turns_and_never_at_rest() -> None:
    truth = FULL_RUNS[World.CARPARK].truth.poses
    motion = between_all(truth[:-1], truth[1:])
    slips = np.any([wheels.draw_slips(truth, stream(seed, "slips")).turn_rad != 0 for seed in range(20)], axis=0)
    turning, at_rest = np.abs(motion[:, 2]) > 0.02, np.abs(motion[:, 0]) < 1e-9
    assert slips[turning].mean() > 4 * slips[~turning & ~at_rest].mean()
    assert not slips[at_rest].any()
