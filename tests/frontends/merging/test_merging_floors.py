"""Maps of several floors are joined floor by floor: WiFi tells which is which, though it is heard next door too."""

from dataclasses import replace

import numpy as np
import pytest
from building_maps.halls import around
from building_maps.rounds import furthest_m
from building_maps.storeys import driven, storeys

from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.events import Verdict
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.merging.merging import Merged, MergeError, merge
from wayfi.frontends.slam_config import SlamConfig

CONFIG = SlamConfig()
BELOW, ABOVE = storeys(alike=True)
WAYS = {0: around(0.0, 96.0), 1: around(60.0, 80.0, back=True, inset_m=5.0)}
GROUND, UPPER = around(20.0, 80.0, inset_m=3.0), around(40.0, 90.0, inset_m=4.5)
FOUND_M = 0.4  # of keyframes on a floor that was joined: rides that contradict each other bend it a little
CARRIED_M = 1.0  # of one that was carried along: a ride errs by 0.005 rad, over 40 m, and by 3 cm


@pytest.fixture(scope="module")
def first() -> BuildingMap:
    return driven({0: BELOW, 1: ABOVE}, WAYS, 1)


@pytest.fixture(scope="module")
def ground() -> BuildingMap:
    return driven({0: BELOW}, {0: GROUND}, 3)


def off_m(merged: Merged, begin: Floats, ways: list[Floats], floor: int) -> float:
    """How far off keyframes of a floor are at most; the frame begins at a pose, `ways` are true, in their order."""
    true = compose_all(Pose2.of(begin).inverse().array(), np.concatenate(ways))
    there = np.array([k.floor == floor for k in merged.building.keyframes])
    return furthest_m(merged.building.poses[there], true[there])


def crossing(merged: Merged) -> int:
    """How many closures relate two floors."""
    keyframes = merged.building.keyframes
    taken = [c.judged for c in merged.building.closures if c.judged.verdict is Verdict.ACCEPTED]
    return sum(keyframes[c.keyframe_a].floor != keyframes[c.keyframe_b].floor for c in taken)


def test_both_floors_are_found_though_the_other_map_begins_on_the_upper_one(first: BuildingMap) -> None:
    other = driven({0: ABOVE, 1: BELOW}, {0: UPPER, 1: GROUND}, 2)
    merged = merge(first, other, CONFIG)
    assert merged.floors == {0: 1, 1: 0}
    assert merged.building.floors == [0, 1]
    ways = [*WAYS.values(), UPPER, GROUND]
    assert off_m(merged, WAYS[0][0], ways, 0) < FOUND_M
    assert crossing(merged) == 0
    assert set(merged.building.grids) == {0, 1}


def test_a_joined_ground_floor_carries_the_upper_one(first: BuildingMap, ground: BuildingMap) -> None:
    merged = merge(ground, first, CONFIG)
    assert merged.floors == {0: 0, 1: 1}
    assert off_m(merged, GROUND[0], [GROUND, *WAYS.values()], 0) < FOUND_M
    assert off_m(merged, GROUND[0], [GROUND, *WAYS.values()], 1) < CARRIED_M
    assert crossing(merged) == 0


def test_floors_that_the_first_map_does_not_know_get_free_numbers_in_order() -> None:
    upper = driven({0: ABOVE}, {0: UPPER}, 4)
    merged = merge(upper, driven({0: BELOW, 1: ABOVE}, WAYS, 1), CONFIG)
    assert merged.floors == {0: 1, 1: 0}
    far = replace(BELOW, name="ee", neighbour=None)
    three = driven({0: far, 1: BELOW, 2: replace(far, name="ff")}, {0: UPPER, 1: GROUND, 2: GROUND}, 5)
    merged = merge(driven({0: BELOW, 1: ABOVE}, WAYS, 1), three, CONFIG)
    assert merged.floors == {0: 2, 1: 0, 2: 3}
    assert merged.building.floors == [0, 1, 2, 3]


def test_a_map_of_the_floor_above_alone_is_none_of_the_floor_below(ground: BuildingMap) -> None:
    """It is heard through the ceiling, and looks the same."""
    with pytest.raises(MergeError, match=r"WiFi contradicts itself|no place of one map"):
        merge(ground, driven({0: ABOVE}, {0: UPPER}, 4), CONFIG)


def test_floors_that_contradict_each_other_are_refused(first: BuildingMap) -> None:
    torn = driven({0: BELOW, 1: ABOVE}, {0: GROUND, 1: UPPER}, 2, slip=Pose2(3.0, 2.0, 0.0))
    with pytest.raises(MergeError, match=r"^the floors contradict each other: by floor 0 .* it lies 3\.\d m"):
        merge(first, torn, CONFIG)
    turned = driven({0: BELOW, 1: ABOVE}, {0: GROUND, 1: UPPER}, 2, slip=Pose2(0.0, 0.0, 0.3))
    with pytest.raises(MergeError, match=r"^the floors contradict each other: .* 0\.[23]\d rad"):
        merge(first, turned, CONFIG)


def test_without_wifi_nothing_tells_which_floor_is_which(first: BuildingMap, ground: BuildingMap) -> None:
    with pytest.raises(MergeError, match="nothing tells which floor is which"):
        merge(replace(ground, fingerprints=[]), first, CONFIG)
