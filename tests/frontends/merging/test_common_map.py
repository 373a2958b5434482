"""Several drives in one hall become one map; what does not belong is left out and said."""

from dataclasses import replace

import numpy as np
import pytest
from building_maps.halls import around, hall, map_of

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.merging.common_map import CommonMap, common_map
from wayfi.frontends.slam_config import SlamConfig

CONFIG = SlamConfig()
HALL = hall()
WAYS = {"a": around(0.0, 96.0), "b": around(60.0, 80.0, back=True, inset_m=5.0), "c": around(20.0, 90.0, inset_m=3.0)}


@pytest.fixture(scope="module")
def parts() -> dict[str, BuildingMap]:
    return {name: map_of(HALL, way, seed=seed) for seed, (name, way) in enumerate(WAYS.items())}


@pytest.fixture(scope="module")
def common(parts: dict[str, BuildingMap]) -> CommonMap:
    return common_map(parts, CONFIG)


def off_m(place: Pose2, way: Floats) -> float:
    """By how much a frame is off at the newest keyframe of its drive, which begins at the first pose of `way`."""
    true = Pose2.of(WAYS["a"][0]).inverse() @ Pose2.of(way[0])
    newest = Pose2.of(way[0]).between(Pose2.of(way[-1]))
    apart = (true @ newest).between(place @ newest)
    return float(np.hypot(apart.x, apart.y))


def test_each_drive_has_its_place(common: CommonMap) -> None:
    assert common.left_out == {}
    assert all(off_m(common.places[name], way) < 0.05 for name, way in WAYS.items())


def test_what_several_have_seen_is_kept_once(common: CommonMap, parts: dict[str, BuildingMap]) -> None:
    first, all_of_them = len(parts["a"].keyframes), sum(len(part.keyframes) for part in parts.values())
    assert first < len(common.building.keyframes) < 0.75 * all_of_them


def test_one_of_another_building_is_left_out_and_the_others_are_joined(parts: dict[str, BuildingMap]) -> None:
    foreign = map_of(hall(9, "bb"), WAYS["a"], seed=9)
    joined = common_map({"a": parts["a"], "foreign": foreign, "b": parts["b"]}, CONFIG)
    assert set(joined.places) == {"a", "b"}
    assert "no place of one map sounds like one of the other" in joined.left_out["foreign"]


def test_one_that_contradicts_itself_is_left_out_and_the_others_are_joined(parts: dict[str, BuildingMap]) -> None:
    fingerprints = [replace(fingerprint, keyframe=9999) for fingerprint in parts["c"].fingerprints]
    joined = common_map({**parts, "c": replace(parts["c"], fingerprints=fingerprints)}, CONFIG)
    assert set(joined.places) == {"a", "b"}
    assert "9999" in joined.left_out["c"]


def test_a_drive_alone_is_the_common_map(parts: dict[str, BuildingMap]) -> None:
    alone = common_map({"b": parts["b"]}, CONFIG)
    assert alone.building is parts["b"]
    assert alone.places["b"].array() == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
