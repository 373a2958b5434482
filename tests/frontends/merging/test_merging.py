import math
from dataclasses import replace

import numpy as np
import pytest
from building_maps.halls import LENGTH_M, Hall, around, hall, map_of
from building_maps.rounds import furthest_m

from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.merging.merging import MergeError, merge
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.simulation.surfaces import box

CONFIG = SlamConfig()
HALL = hall()
FIRST, OTHER_WAY = around(0.0, 96.0), around(60.0, 80.0, back=True, inset_m=5.0)


def off(T_a_b: Pose2, truth_a: Floats, truth_b: Floats) -> tuple[float, float]:
    """By how many m and rad two maps are off each other, in the middle of the hall."""
    true = Pose2.of(truth_a[0]).between(Pose2.of(truth_b[0]))
    middle = Pose2.of(truth_b[0]).inverse().transform(np.array([[LENGTH_M / 2, 12.0]]))
    return math.hypot(*(true.transform(middle) - T_a_b.transform(middle))[0]), abs(true.between(T_a_b).theta)


@pytest.fixture(scope="module")
def first() -> BuildingMap:
    return map_of(HALL, FIRST)


@pytest.fixture(scope="module")
def second() -> BuildingMap:
    return map_of(HALL, OTHER_WAY, seed=1)


def test_two_drives_in_one_hall_become_one_map(first: BuildingMap, second: BuildingMap) -> None:
    merged = merge(first, second, CONFIG)
    metres, radians = off(merged.T_a_b, FIRST, OTHER_WAY)
    assert metres < 0.05
    assert radians < 0.005
    expected = compose_all(Pose2.of(FIRST[0]).inverse().array(), np.concatenate([FIRST, OTHER_WAY]))
    assert furthest_m(merged.building.poses, expected) < 0.15
    assert merged.checks >= 5
    assert merged.spread_m > 20.0


def test_it_does_not_matter_which_is_the_first(first: BuildingMap, second: BuildingMap) -> None:
    assert off(merge(second, first, CONFIG).T_a_b, OTHER_WAY, FIRST)[0] < 0.05


def test_without_scans_wifi_joins_them_more_coarsely() -> None:
    a, b = map_of(HALL, FIRST, laser=False), map_of(HALL, OTHER_WAY, seed=1, laser=False)
    merged = merge(a, b, CONFIG)
    assert off(merged.T_a_b, FIRST, OTHER_WAY)[0] < 1.5
    assert merged.checks == 0


def test_without_wifi_the_laser_finds_one_in_the_other(first: BuildingMap, second: BuildingMap) -> None:
    merged = merge(replace(first, fingerprints=[]), second, CONFIG)
    assert off(merged.T_a_b, FIRST, OTHER_WAY)[0] < 0.05
    assert (merged.places, merged.checks >= 12) == (0, True)


@pytest.mark.slow
def test_without_wifi_another_hall_is_refused(first: BuildingMap) -> None:
    other = map_of(Hall(1.3 * hall(5).walls - 3.0, "aa", HALL.places), OTHER_WAY, wifi=False)
    with pytest.raises(MergeError, match=r"the laser does not find|does not confirm|in more than one way|contradicts"):
        merge(first, other, CONFIG)


@pytest.mark.slow
def test_without_wifi_a_hall_that_looks_alike_from_both_ends_is_refused() -> None:
    bare = Hall(box(0.0, 0.0, LENGTH_M, 24.0), "aa", HALL.places)
    maps = [map_of(bare, truth, seed=seed, wifi=False) for seed, truth in enumerate((FIRST, OTHER_WAY))]
    with pytest.raises(MergeError, match=r"in more than one way|does not confirm|does not find"):
        merge(*maps, CONFIG)


def test_a_hall_with_other_access_points_is_another_building(first: BuildingMap) -> None:
    with pytest.raises(MergeError, match="no place of one map sounds like one of the other"):
        merge(first, map_of(hall(name="bb"), OTHER_WAY), CONFIG)


def test_access_points_that_were_carried_into_another_hall_do_not_make_it_this_one(first: BuildingMap) -> None:
    """WiFi fits, the walls do not."""
    elsewhere = Hall(1.3 * hall(5).walls - 3.0, HALL.name, HALL.places)
    with pytest.raises(MergeError, match=r"the laser does not confirm it|the laser contradicts WiFi|look through"):
        merge(first, map_of(elsewhere, OTHER_WAY), CONFIG)


def test_furniture_may_have_moved(first: BuildingMap) -> None:
    refurnished = Hall(hall(5).walls, HALL.name, HALL.places)
    merged = merge(first, map_of(refurnished, OTHER_WAY), CONFIG)
    assert off(merged.T_a_b, FIRST, OTHER_WAY)[0] < 0.1


def test_access_points_that_all_stand_elsewhere_contradict_each_other(first: BuildingMap) -> None:
    moved = Hall(HALL.walls, HALL.name, np.random.default_rng(3).uniform([0, 0], [40, 24], HALL.places.shape))
    with pytest.raises(MergeError, match=r"WiFi contradicts itself|overlap too little|no place of one map"):
        merge(first, map_of(moved, OTHER_WAY), CONFIG)


def test_a_few_metres_in_common_are_too_little(first: BuildingMap) -> None:
    with pytest.raises(MergeError, match="overlap too little"):
        merge(first, map_of(HALL, OTHER_WAY[:12]), CONFIG)


def test_maps_that_have_nothing_in_common_are_told(first: BuildingMap) -> None:
    deaf, blind = replace(first, fingerprints=[]), map_of(HALL, OTHER_WAY, laser=False)
    with pytest.raises(MergeError, match="neither WiFi nor scans in common"):
        merge(deaf, blind, CONFIG)
    empty = replace(first, keyframes=[], poses=np.zeros((0, 3)))
    with pytest.raises(MergeError, match="without keyframes"):
        merge(first, empty, CONFIG)
