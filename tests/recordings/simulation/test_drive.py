"""The drives: with smooth corners or turns on the spot, the first loop short or long, racks open or closed."""

import numpy as np
import pytest
from drives import whole_run

from wayfi.backend.pose2 import between_all, wrap_all
from wayfi.recordings.simulation.run import Run
from wayfi.recordings.simulation.worlds import warehouse
from wayfi.recordings.simulation.worlds.blueprints import BLUEPRINTS, World


def turned_on_the_spot_rad(run: Run) -> float:
    motion = between_all(run.truth.poses[:-1], run.truth.poses[1:])
    return float(np.abs(motion[motion[:, 0] < 1e-3, 2]).sum())


def corners_rad(world: World, seed: int) -> float:
    """The angles of all corners that the route of `seed` reaches."""
    blueprint = BLUEPRINTS[world]
    route = blueprint.other_route if seed % 2 and blueprint.other_route else blueprint.route
    sides = np.diff(route.corners, axis=0)
    reached = np.hypot(*sides.T).cumsum()[:-1] < route.length_m
    return float(np.abs(wrap_all(np.diff(np.arctan2(sides[:, 1], sides[:, 0]))))[reached].sum())


def first_revisit_m(run: Run) -> float:
    """The path until the robot is within a metre of where it was 20 m of path or more ago."""
    way = run.drive.at(np.arange(0.0, run.truth.path_m()[-1], 1.0))[:, :2]
    apart = np.hypot(*(way[:, None] - way[None]).transpose(2, 0, 1))
    return float(np.tril(apart < 1.0, -20).any(axis=1).argmax())


@pytest.mark.parametrize("world", World, ids=str)
def test_some_drives_turn_on_the_spot_at_each_corner_and_some_nowhere(world: World) -> None:
    turned = np.array([turned_on_the_spot_rad(whole_run(world, seed)) for seed in range(4)])
    corners = np.array([corners_rad(world, seed) for seed in range(4)])
    nowhere, at_each = turned < 0.5, np.abs(turned / corners - 1.0) < 0.02
    assert nowhere.any()
    assert at_each.any()
    assert (nowhere | at_each).all()


@pytest.mark.parametrize("world", World, ids=str)
def test_a_turn_on_the_spot_begins_and_ends_gently(world: World) -> None:
    for seed in range(4):
        motion = between_all(whole_run(world, seed).truth.poses[:-1], whole_run(world, seed).truth.poses[1:])
        turning = motion[:, 0] < 1e-3
        rates = motion[:, 2] / 0.1
        assert np.abs(rates[turning]).max() < 0.65
        assert np.abs(np.diff(rates)[turning[1:] & turning[:-1]]).max() / 0.1 < 3.0  # rad/s^2, where it stops in a turn


def test_odd_seeds_go_around_the_car_park_before_they_close_a_loop() -> None:
    for seed in range(4):
        least, most = (395, 430) if seed % 2 else (60, 140)
        assert least < first_revisit_m(whole_run(World.CARPARK, seed)) < most


def test_warehouse_and_campus_close_late_anyway() -> None:
    assert first_revisit_m(whole_run(World.WAREHOUSE, 0)) > 400
    assert first_revisit_m(whole_run(World.CAMPUS, 0)) > 400


def test_racks_are_open_in_some_drives_closed_in_others() -> None:
    closed = [
        (np.hypot(*(faces[:, 2:] - faces[:, :2]).T) > 39.0).sum() / 2 - 2
        for faces in (
            warehouse.surfaces(whole_run(World.WAREHOUSE, 0).drive, np.random.default_rng(s)).ends for s in range(9)
        )
    ]
    assert {0.0, 13.0} <= set(closed)
    assert any(0 < count < 13 for count in closed)
