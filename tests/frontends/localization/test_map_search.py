"""The search of a whole map: any place, any heading; look-alikes are told, and nothing is compared without end."""

import math
from dataclasses import replace

import numpy as np
import pytest
from building_maps.seen import seen_map
from rooms import HALL, TWO_FOLD, see, see_ahead

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.localization.map_search import MapSearch, Region, SearchResult
from wayfi.frontends.localization.search_config import MapSearchConfig
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.scan_points import ScanPoints
from wayfi.recordings.simulation.surfaces import box

CONFIG = MapSearchConfig(max_waiting=200_000)
HERE = np.zeros((1, 3))
PATH = np.array([[-5.0 + k, -2.5, 0.0] for k in range(13)] + [[7.5, 4.0, 2.0], [-4.5, 3.5, -2.0]])
ASIDE = np.array([40.0, 0.0, 40.0, 0.0])  # a second hall like the first, 40 m away
BOX = box(-4.5, -1.0, -3.5, 0.5)


def hall() -> BuildingMap:
    return seen_map((HALL, PATH))


def searched(search: MapSearch, scan: ScanPoints, region: Region | None = None, work: int = 100_000) -> SearchResult:
    assert search.begin([scan], HERE, region)
    while (result := search.go_on(work)) is None:
        pass
    return result


def seen(faces: Floats, pose: Pose2) -> ScanPoints:
    return see(faces, pose, np.random.default_rng(1))


def assert_at(found: Pose2, truth: Pose2) -> None:
    assert found.distance(truth) < 0.08  # a cell and a half of the finest field; scan matching goes on from there
    assert abs(wrap(found.theta - truth.theta)) < math.radians(0.5)


@pytest.fixture(scope="module")
def search() -> MapSearch:
    return MapSearch(hall(), CONFIG)


@pytest.mark.parametrize("truth", [Pose2(0.0, -2.0, 0.3), Pose2(7.5, -3.0, 3.1), Pose2(-5.0, 1.0, -1.6)])
def test_a_robot_is_found_wherever_it_stands(search: MapSearch, truth: Pose2) -> None:
    result = searched(search, seen(HALL, truth))
    assert result.complete
    assert_at(result.places[0].T_map_base, truth)
    assert result.places[0].score > 0.9


def test_a_laser_that_sees_half_as_much_is_found(search: MapSearch) -> None:
    truth = Pose2(0.0, -2.0, 2.3)
    assert_at(searched(search, see_ahead(HALL, truth)).places[0].T_map_base, truth)


def test_a_robot_is_found_though_people_stand_around(search: MapSearch) -> None:
    truth = Pose2(0.0, -2.0, 0.3)
    people = np.concatenate([box(x, y, x + 0.3, y + 0.3) for x, y in [(0.8, -2.2), (-1.2, -1.0), (-0.5, -3.2)]])
    result = searched(search, seen(np.concatenate([HALL, people]), truth))
    assert_at(result.places[0].T_map_base, truth)


def test_scans_from_along_the_path_are_searched_for_together(search: MapSearch) -> None:
    truth, before = Pose2(0.0, -2.0, 0.3), Pose2(-2.0, -2.5, 0.0)
    poses = np.stack([Pose2().array(), truth.between(before).array()])
    assert search.begin([seen(HALL, truth), seen(HALL, before)], poses)
    while (result := search.go_on(100_000)) is None:
        pass
    assert_at(result.places[0].T_map_base, truth)


def test_all_places_that_look_alike_are_told() -> None:
    both = np.concatenate([HALL, HALL + ASIDE])
    search = MapSearch(seen_map((both, PATH), (both, PATH + np.array([40.0, 0.0, 0.0]))), CONFIG)
    result = searched(search, seen(HALL, Pose2(0.0, -2.0, 0.3)))
    assert result.complete
    best, other = result.places[:2]
    assert other.score > 0.97 * best.score
    first, second = sorted((best, other), key=lambda place: place.T_map_base.x)
    assert_at(first.T_map_base, Pose2(0.0, -2.0, 0.3))
    assert_at(second.T_map_base, Pose2(40.0, -2.0, 0.3))


def test_a_hall_that_looks_the_same_turned_round_has_two_places() -> None:
    half_round = np.array([[-3.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-3.0, 2.0, 0.0], [0.0, 2.5, 0.0]])
    path = np.concatenate([half_round, half_round * [-1, -1, 1] + [0.0, 0.0, math.pi]])
    result = searched(MapSearch(seen_map((TWO_FOLD, path)), CONFIG), seen(TWO_FOLD, Pose2(0.0, 2.0, 0.5)))
    assert len(result.places) == 2
    there, turned = sorted(result.places, key=lambda place: -place.T_map_base.y)
    assert_at(there.T_map_base, Pose2(0.0, 2.0, 0.5))
    assert_at(turned.T_map_base, Pose2(0.0, -2.0, 0.5 - math.pi))


def test_a_scan_of_another_building_has_no_place_that_fits_as_well(search: MapSearch) -> None:
    faces = np.concatenate([box(-2.0, -9.0, 3.0, 12.0), box(0.0, 4.0, 0.7, 5.1), box(1.2, -5.0, 1.5, -3.5)])
    result = searched(search, seen(faces, Pose2(0.5, 1.0, 0.4)))
    assert all(place.score < 0.8 for place in result.places)


def test_in_a_region_only_its_poses_are_compared(search: MapSearch) -> None:
    scan = seen(HALL, Pose2(0.0, -2.0, 0.3))
    whole, near = searched(search, scan), searched(search, scan, Region(1.0, -1.5, 2.0))
    assert_at(near.places[0].T_map_base, Pose2(0.0, -2.0, 0.3))
    assert near.poses < 0.5 * whole.poses
    elsewhere = searched(search, scan, Region(7.0, 3.5, 2.0))
    assert all(place.T_map_base.distance(Pose2(7.0, 3.5)) < 2.0 + 8 * CONFIG.cell_m for place in elsewhere.places)


def test_however_finely_it_is_sliced_it_finds_the_same() -> None:
    scan = seen(HALL, Pose2(0.0, -2.0, 0.3))
    assert searched(MapSearch(hall(), CONFIG), scan, work=5_000) == searched(
        MapSearch(hall(), CONFIG), scan, work=10**9
    )


def test_what_was_moved_away_is_no_wall_any_more() -> None:
    with_box = np.concatenate([HALL, BOX])
    search = MapSearch(seen_map((with_box, PATH[:3]), (HALL, np.repeat(PATH, 4, axis=0))), CONFIG)
    scan = seen(HALL, Pose2(-5.0, -2.0, 1.0))
    assert searched(search, scan) == searched(
        MapSearch(seen_map((HALL, PATH[:3]), (HALL, np.repeat(PATH, 4, axis=0))), CONFIG), scan
    )


def test_few_points_are_not_searched_for(search: MapSearch) -> None:
    scan = seen(HALL, Pose2(0.0, -2.0, 0.3))
    assert not search.begin([replace(scan, points=scan.points[:20], normals=scan.normals[:20])], HERE)
    assert not search.begin([], np.empty((0, 3)))
    assert search.go_on(100_000) is None


def test_a_map_without_keyframes_has_no_places() -> None:
    result = searched(MapSearch(seen_map(), CONFIG), seen(HALL, Pose2()))
    assert result.places == ()


@pytest.mark.parametrize("bound", [{"max_poses": 2_000}, {"most_refined": 1}, {"max_waiting": 10}])
def test_a_search_that_ends_at_a_bound_is_not_complete(bound: dict[str, int]) -> None:
    search = MapSearch(hall(), replace(CONFIG, **bound))
    assert not searched(search, seen(HALL, Pose2(0.0, -2.0, 0.3))).complete
