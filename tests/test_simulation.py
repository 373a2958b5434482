"""Simulated recordings: what they promise about their bytes, the drive and the drift of the wheels."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from wayfi.backend.pose2 import between_all
from wayfi.frontends.measurements import LaserScan, Odometry, StaticTransforms, WifiScan
from wayfi.recordings.simulation import wheels
from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.run import Run, measurements, odometry, start
from wayfi.recordings.simulation.worlds import World

Floats = NDArray[np.float64]

FULL_RUNS = {world: start(world, seed=3) for world in World}


@pytest.fixture(params=list(World), ids=str)
def run(request: pytest.FixtureRequest) -> Run:
    return FULL_RUNS[World(request.param)]


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
    run = start(world, seed, minutes)
    return aligned_rmse_m(np.array([m.pose.array() for m in odometry(run)]), run.truth.poses)


# The recording


def test_same_arguments_same_bytes(tmp_path: Path) -> None:
    first, again = (simulate(World.CARPARK, tmp_path / name, seed=7, minutes=0.2) for name in "ab")
    assert first.recording.read_bytes() == again.recording.read_bytes()
    assert first.truth.read_bytes() == again.truth.read_bytes()


def test_another_seed_is_another_recording(tmp_path: Path) -> None:
    first, other = (simulate(World.CARPARK, tmp_path / str(seed), seed, minutes=0.05) for seed in (1, 2))
    assert first.recording.read_bytes() != other.recording.read_bytes()


def test_progress_rises_to_one(tmp_path: Path) -> None:
    fractions: list[float] = []
    simulate(World.OFFICE, tmp_path, minutes=0.1, progress=fractions.append)
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


def test_a_cut_drive_is_the_beginning_of_the_whole() -> None:
    cut, longer = (measurements(start(World.WAREHOUSE, 5, minutes)) for minutes in (0.1, 0.2))
    for a, b in zip(cut, longer, strict=False):
        assert (type(a), a.stamp_ns) == (type(b), b.stamp_ns)
        if isinstance(a, LaserScan) and isinstance(b, LaserScan):
            np.testing.assert_array_equal(a.ranges, b.ranges)
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


def test_starts_at_rest_at_the_origin(run: Run) -> None:
    np.testing.assert_allclose(run.truth.poses[:10], 0.0, atol=1e-3)


def test_speeds_turns_and_accelerations_are_a_robots(run: Run) -> None:
    motion = between_all(run.truth.poses[:-1], run.truth.poses[1:]) / 0.1
    assert motion[:, 0].min() >= 0.0
    assert 0.4 < motion[:, 0].max() < 0.6
    assert np.abs(motion[:, 1]).max() < 0.02
    assert np.abs(motion[:, 2]).max() < 0.65
    assert np.abs(np.diff(motion[:, 0])).max() / 0.1 < 0.9


def test_keeps_away_from_everything(run: Run) -> None:
    times_s = np.arange(0.0, run.length_ns / 1e9, 0.7)
    nearest = [
        distances_m(pose[:2], run.surfaces.at(t)).min()
        for t, pose in zip(times_s, run.drive.poses(times_s), strict=True)
    ]
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
    reported = wheels.odometry(truth, 0.1, wheels.Wheels(1.0, 1.0, 0.0, 0.0), np.random.default_rng(0))
    assert 0.0 < aligned_rmse_m(reported, truth) < 0.2
