"""Runs through every world: the drive is a robot's, and keeps away from everything."""

import numpy as np
import pytest
from drives import whole_run
from rooms import distances_m, faces_at

from wayfi.backend.pose2 import between_all
from wayfi.frontends.measurements import LaserScan, Odometry, WifiScan
from wayfi.recordings.simulation.robots.models import Robot
from wayfi.recordings.simulation.run import Run, measurements, start, wifi_scans
from wayfi.recordings.simulation.worlds.blueprints import BLUEPRINTS, World

SEED = 3


@pytest.fixture(params=list(World), ids=str)
def world(request: pytest.FixtureRequest) -> World:
    return World(request.param)


@pytest.fixture
def run(world: World) -> Run:
    return whole_run(world, SEED)


@pytest.mark.parametrize("robot", [Robot.TYPICAL, Robot.CHEAP], ids=str)
def test_the_robot_changes_neither_the_truth_nor_the_wifi(world: World, robot: Robot) -> None:
    some, ideal = (start(world, 4, minutes=0.5, robot=model) for model in (robot, Robot.IDEAL))
    np.testing.assert_array_equal(some.truth.poses, ideal.truth.poses)
    for a, b in zip(wifi_scans(some), wifi_scans(ideal), strict=True):
        assert a.bssids == b.bssids
        np.testing.assert_array_equal(a.rssi, b.rssi)


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


def test_length_and_duration_are_those_of_the_paper() -> None:
    run = whole_run(World.CARPARK, SEED)
    assert run.length_ns / 1e9 == pytest.approx(2580.0, abs=1.0)
    assert run.truth.path_m()[-1] == pytest.approx(1070.0, abs=1.0)


def test_every_drive_is_as_long_as_planned(world: World) -> None:
    run, plan = whole_run(world, SEED), BLUEPRINTS[world].route
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
        nearest += [distances_m(pose[None, :2], faces_at(near, t))[0] for t, pose in zip(times_s, poses, strict=True)]
    assert min(nearest) > 0.25


def test_five_minutes_revisit_a_place() -> None:
    for seed in range(0, 8, 2):  # of the odd ones, the first loop is of 400 m
        poses = start(World.CARPARK, seed, minutes=5.0).truth.poses
        early, late = poses[:900:5], poses[2400:2700:5]
        gaps = np.hypot(*(early[:, None, :2] - late[None, :, :2]).transpose(2, 0, 1))
        assert (gaps.min(axis=0) < 1.0).mean() > 0.9
