"""People who walk near the robot."""

import numpy as np
import pytest
from drives import whole_run
from rooms import distances_m, faces_at

from wayfi.recordings.simulation.people import people
from wayfi.recordings.simulation.run import Run, stream
from wayfi.recordings.simulation.surfaces import Surfaces
from wayfi.recordings.simulation.worlds.blueprints import BLUEPRINTS, World


def legs(run: Run, world: World) -> Surfaces:
    return people(run.drive, BLUEPRINTS[world].aisle_m, stream(3, "people"))


@pytest.mark.parametrize("world", list(World), ids=str)
def test_people_are_near_the_robot_for_a_while_and_never_on_it(world: World) -> None:
    run = whole_run(world, seed=3)
    walking = legs(run, world)
    times_s = np.arange(0.0, run.length_ns / 1e9, 2.9)
    gaps = []
    for time_s, pose in zip(times_s, run.drive.poses(times_s), strict=True):
        there = faces_at(walking, time_s)
        gaps.append(distances_m(pose[None, :2], there)[0] if len(there) else np.inf)
    assert min(gaps) > 0.25
    assert 0.1 < (np.array(gaps) < 5.0).mean() < 0.7


def test_people_walk_at_a_persons_pace_on_two_legs() -> None:
    run = whole_run(World.CARPARK, seed=3)
    walking = legs(run, World.CARPARK)
    swings = np.hypot(*walking.velocity_xy[walking.moves].T)
    assert np.quantile(swings, 0.99) < 3.5
    assert 1.0 < np.median(swings) < 3.0
    stand = ~walking.moves
    np.testing.assert_allclose((walking.until_s - walking.since_s)[stand], 0.5)
