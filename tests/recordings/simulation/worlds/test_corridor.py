"""The long bare corridors: hundreds of metres driven again, of which the laser sees two walls and hardly a niche."""

import math

import numpy as np
import pytest

from wayfi.recordings.simulation.robots.models import Robot
from wayfi.recordings.simulation.run import Run, start, wifi_scans
from wayfi.recordings.simulation.worlds import corridor
from wayfi.recordings.simulation.worlds.blueprints import World

RUNS = {world: start(world, seed=0, robot=Robot.IDEAL) for world in (World.CORRIDOR, World.RING)}


@pytest.fixture(params=list(RUNS), ids=str)
def run(request: pytest.FixtureRequest) -> Run:
    return RUNS[World(request.param)]


def test_a_kilometre_of_which_most_is_driven_again(run: Run) -> None:
    assert 1000.0 < run.truth.path_m()[-1] < 1400.0
    way = run.drive.at(np.arange(0.0, 1100.0, 1.0))[:, :2]
    apart = np.hypot(*(way[:, None] - way[None]).transpose(2, 0, 1))
    assert 0.6 < np.tril(apart < 1.0, -30).any(axis=1).mean() < 0.8


def test_along_nearly_all_of_the_way_there_is_nothing_in_sight_but_two_walls(run: Run) -> None:
    corners = run.surfaces.ends[:, :2]
    at = run.drive.at(np.arange(0.0, 1100.0, 2.0))[:, :2]
    nearest_m = np.hypot(*(at[:, None] - corners).transpose(2, 0, 1)).min(axis=1)
    assert np.mean(nearest_m > corridor.LASER.range_max_m) > 0.7


def test_the_robot_turns_in_the_straight_corridor_where_it_sees_no_end() -> None:
    at = RUNS[World.CORRIDOR].truth.poses[:, 0]
    assert at.min() - corridor.WEST_M > corridor.LASER.range_max_m
    assert corridor.EAST_M - at.max() > corridor.LASER.range_max_m


def test_the_ring_is_driven_both_ways() -> None:
    poses = RUNS[World.RING].truth.poses
    south = poses[(np.abs(poses[:, 0]) < 1.0) & (np.abs(poses[:, 1]) < 1.0)]
    headings = np.cos(south[:, 2])
    assert headings.max() > math.cos(0.2)
    assert headings.min() < -math.cos(0.2)


def test_wifi_is_heard_everywhere_from_few_access_points(run: Run) -> None:
    heard = np.array([len(scan.bssids) for scan in wifi_scans(run)])[::10]
    assert np.mean(heard == 0) < 0.02
    assert 4 < np.median(heard) < 30
