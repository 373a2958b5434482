"""Scans contradict each other, and the map, only by what rays pass: not by what is new, hidden or out of sight."""

import math

import numpy as np
import pytest
from rooms import CORRIDOR, HALL, LIDAR, see, see_ahead

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.laser_points import scan_from_points
from wayfi.frontends.lidar.visibility import (
    VisibilityConfig,
    agreement,
    fit_in_sight,
    in_view,
    seen_through_count,
    seen_through_share,
)
from wayfi.frontends.scan_points import ScanPoints
from wayfi.recordings.simulation.surfaces import box

CONFIG = VisibilityConfig()
A = Pose2(-1.0, -2.0, 0.0)
HERE = Pose2(-2.0, -2.0, 0.4)
BACK = Pose2(0.0, 0.0, math.pi)
AT_ORIGIN = np.zeros((1, 3))


def walls(seed: int = 1) -> Floats:
    """The hall as it is seen from three places, in its own frame."""
    rng = np.random.default_rng(seed)
    places = [Pose2(-4.0, 0.0, 0.0), Pose2(0.0, 1.0, 2.0), Pose2(4.0, -2.0, -2.0)]
    return np.concatenate([place.transform(see(HALL, place, rng).points) for place in places])


def scan(pose: Pose2, *more: Floats) -> ScanPoints:
    return see(np.concatenate([HALL, *more]), pose, np.random.default_rng(2))


def test_a_scan_where_it_was_taken_looks_through_nothing() -> None:
    assert seen_through_share(scan(HERE), walls(), HERE, CONFIG) < 0.02


@pytest.mark.parametrize("off", [Pose2(2.5, 0.0, 0.0), Pose2(0.0, 2.0, 1.5), Pose2(0.0, 0.0, math.pi / 2)])
def test_a_scan_that_was_taken_elsewhere_looks_through_walls(off: Pose2) -> None:
    assert seen_through_share(scan(HERE), walls(), HERE @ off, CONFIG) > 0.3


def test_people_around_the_robot_hide_walls_and_are_no_contradiction() -> None:
    crowd = [
        box(HERE.x + x, HERE.y + y, HERE.x + x + 0.5, HERE.y + y + 0.5) for x, y in ((0.8, -1), (0.5, 1), (-1.5, 0))
    ]
    assert seen_through_share(scan(HERE, *crowd), walls(), HERE, CONFIG) < 0.02


def test_a_room_that_the_map_does_not_hold_is_no_contradiction() -> None:
    known = walls()
    assert seen_through_share(scan(HERE), known[known[:, 0] > 3.0], HERE, CONFIG) < 0.05


def test_too_few_walls_in_view_are_no_evidence() -> None:
    elsewhere = HERE @ Pose2(2.5, 0.0, 0.0)
    assert seen_through_share(scan(HERE), walls()[: CONFIG.min_in_view - 1], elsewhere, CONFIG) == 0.0


def test_a_point_in_view_is_passed_or_met_or_hidden() -> None:
    points = np.array([[-5.5, 0.0], [-6.1, 0.0], [-6.6, 0.0], [3.0, -2.0]]) - (A.x, A.y)
    view = in_view(see(HALL, A @ BACK, np.random.default_rng(0)), BACK, points, CONFIG)
    assert view.passed.tolist() == [True, False, False, False]  # the last one lies where the laser does not look
    assert view.met.tolist() == [False, True, False, False]


def test_rays_on_both_sides_of_straight_back_are_neighbours() -> None:
    turn = np.linspace(-math.pi, math.pi, 181)[:-1] + 0.01
    circle = scan_from_points(5.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1), Pose2(), LIDAR)
    behind = np.array([[-4.0, 0.0], [-4.0, 0.02], [-4.0, -0.02]])
    assert in_view(circle, Pose2(), behind, CONFIG).passed.all()


def test_no_rays_see_nothing() -> None:
    nothing = ScanPoints(np.empty((0, 2)), np.empty((0, 2)), Pose2())
    assert not in_view(nothing, Pose2(), walls(), CONFIG).passed.any()
    assert seen_through_share(nothing, walls(), HERE, CONFIG) == 0.0


def test_a_scan_does_not_contradict_itself() -> None:
    scan = see_ahead(HALL, A)
    assert seen_through_count(scan, Pose2(), [scan], AT_ORIGIN, CONFIG) == 0


def test_what_stands_where_rays_passed_is_seen_through() -> None:
    before, now = see_ahead(HALL, A), see_ahead(np.concatenate([HALL, box(0.5, -2.5, 1.5, -1.5)]), A)
    near = np.hypot(*now.points.T) < 2.5
    through = seen_through_count(now, Pose2(), [before], AT_ORIGIN, CONFIG)
    assert 10 < through <= near.sum()
    assert agreement(1 - near.mean(), now, Pose2(), [before], AT_ORIGIN, CONFIG) < 1.0


def test_what_is_behind_a_wall_or_out_of_sight_is_not_seen_through() -> None:
    before = see_ahead(HALL, A)
    behind, beyond = see_ahead(HALL, A @ BACK), see_ahead(box(-30.0, -30.0, 30.0, 30.0), A)
    assert seen_through_count(behind, BACK, [before], AT_ORIGIN, CONFIG) == 0
    assert seen_through_count(beyond, Pose2(), [before], AT_ORIGIN, CONFIG) == 0


def near(pose: Pose2, reach_m: float = 6.0) -> ScanPoints:
    """What a short-sighted laser sees of the bare corridor."""
    seen = see(CORRIDOR, pose, np.random.default_rng(3))
    return scan_from_points(seen.points[np.hypot(*seen.points.T) < reach_m], Pose2(), LIDAR)


@pytest.mark.parametrize(("step_m", "inlier_ratio"), [(1.0, 0.85), (0.0, 1.0)])
def test_all_that_is_in_sight_fits_ahead_in_a_corridor_as_well_as_behind(step_m: float, inlier_ratio: float) -> None:
    place = Pose2(step_m, 0.0, 0.0)
    fit = fit_in_sight(inlier_ratio, near(Pose2(1.0, 0.0, 0.0)), place, [near(Pose2())], AT_ORIGIN, CONFIG)
    assert fit > 0.95


def test_where_all_is_in_sight_the_share_is_that_of_all_points() -> None:
    assert fit_in_sight(0.5, near(Pose2()), Pose2(), [near(Pose2())], AT_ORIGIN, CONFIG) == pytest.approx(0.5, abs=0.05)
    assert fit_in_sight(0.0, near(Pose2()), Pose2(0.0, 0.5, 0.0), [near(Pose2())], AT_ORIGIN, CONFIG) == 0.0
