"""A scan contradicts the map only by what it looks through: not by what is new, or hidden."""

import math

import numpy as np
import pytest
from rooms import HALL, see

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.visibility import LEAST_IN_VIEW, seen_through_share
from wayfi.frontends.scan_points import ScanPoints
from wayfi.recordings.simulation.surfaces import box

HERE = Pose2(-2.0, -2.0, 0.4)


def walls(seed: int = 1) -> Floats:
    """The hall as it is seen from three places, in its own frame."""
    rng = np.random.default_rng(seed)
    places = [Pose2(-4.0, 0.0, 0.0), Pose2(0.0, 1.0, 2.0), Pose2(4.0, -2.0, -2.0)]
    return np.concatenate([place.transform(see(HALL, place, rng).points) for place in places])


def scan(pose: Pose2, *more: Floats) -> ScanPoints:
    return see(np.concatenate([HALL, *more]), pose, np.random.default_rng(2))


def test_a_scan_where_it_was_taken_looks_through_nothing() -> None:
    assert seen_through_share(scan(HERE), walls(), HERE) < 0.02


@pytest.mark.parametrize("off", [Pose2(2.5, 0.0, 0.0), Pose2(0.0, 2.0, 1.5), Pose2(0.0, 0.0, math.pi / 2)])
def test_a_scan_that_was_taken_elsewhere_looks_through_walls(off: Pose2) -> None:
    assert seen_through_share(scan(HERE), walls(), HERE @ off) > 0.3


def test_people_around_the_robot_hide_walls_and_are_no_contradiction() -> None:
    crowd = [
        box(HERE.x + x, HERE.y + y, HERE.x + x + 0.5, HERE.y + y + 0.5) for x, y in ((0.8, -1), (0.5, 1), (-1.5, 0))
    ]
    assert seen_through_share(scan(HERE, *crowd), walls(), HERE) < 0.02


def test_a_room_that_the_map_does_not_hold_is_no_contradiction() -> None:
    known = walls()
    assert seen_through_share(scan(HERE), known[known[:, 0] > 3.0], HERE) < 0.05


def test_too_few_walls_in_view_are_no_evidence() -> None:
    elsewhere = HERE @ Pose2(2.5, 0.0, 0.0)
    assert seen_through_share(scan(HERE), walls()[: LEAST_IN_VIEW - 1], elsewhere) == 0.0
