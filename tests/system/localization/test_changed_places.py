"""A robot that is switched on where not all is as it was: what it finds, and what it says.

Distances are of claimed poses from the truth, in the frame of the map; nothing is aligned.
"""

from pathlib import Path

import numpy as np
import pytest
from buildings.localizing import Localised, Mapped, localised, map_of
from buildings.robots import Robot, drive
from buildings.storey import CABIN_XY, TWIN_ROUTE, Storey, another_building, storey, twin_halls

from wayfi.backend.pose2 import Pose2

WAY = ((18.0, 12.5), (24.0, 12.5), (24.0, 7.5), (9.0, 7.5), (9.0, 2.5), (3.0, 2.5))
ELSEWHERE = tuple((0.8 * x, 17.25 - 1.15 * y) for x, y in WAY)
RIGHT_M, FALSE_M = 0.3, 1.0
OLD = storey()


def on_the_way(mapped: Mapped, folder: Path, place: Storey = OLD, robot: Robot | None = None) -> Localised:
    return localised(mapped, drive(place, WAY, day=1, robot=robot or Robot()), folder)


def assert_found(result: Localised, within_s: float) -> None:
    assert result.states[0] == "RELOCALISING"
    assert result.states[-1] == "TRACKING", result.reasons
    assert result.report["localization"]["found_after_s"] <= within_s
    assert result.errors_m.max() < RIGHT_M


def assert_nothing_false(result: Localised) -> None:
    assert result.errors_m.max(initial=0.0) < FALSE_M


def test_as_it_was_it_is_found_within_seconds(mapped: Mapped, tmp_path: Path) -> None:
    assert_found(on_the_way(mapped, tmp_path), within_s=10.0)


def test_another_building_is_never_claimed(mapped: Mapped, tmp_path: Path) -> None:
    result = localised(mapped, drive(another_building(), ELSEWHERE, day=1), tmp_path)
    assert len(result.errors_m) == 0
    assert set(result.states) <= {"RELOCALISING", "LOST"}
    assert result.report["localization"]["found_after_s"] is None


def test_with_another_mount_of_the_laser_it_is_found(mapped: Mapped, tmp_path: Path) -> None:
    assert_found(on_the_way(mapped, tmp_path, robot=Robot(Pose2(-0.15, 0.1, 2.8))), within_s=15.0)


def test_after_all_furniture_was_moved_it_is_found_or_not_claimed(mapped: Mapped, tmp_path: Path) -> None:
    result = on_the_way(mapped, tmp_path, OLD.refurnished(77))
    assert_nothing_false(result)


def test_without_wifi_the_laser_alone_finds_it(mapped: Mapped, tmp_path: Path) -> None:
    assert_found(on_the_way(mapped, tmp_path, robot=Robot(wifi=False)), within_s=30.0)


def test_where_every_access_point_was_replaced_the_laser_finds_it(mapped: Mapped, tmp_path: Path) -> None:
    result = on_the_way(mapped, tmp_path, OLD.with_other_access_points())
    assert_nothing_false(result)


def test_where_every_third_access_point_was_moved_nothing_false_is_claimed(mapped: Mapped, tmp_path: Path) -> None:
    assert_nothing_false(on_the_way(mapped, tmp_path, OLD.with_moved_access_points(0.3)))


def test_in_an_elevator_nothing_is_claimed_until_its_door_opens(mapped: Mapped, tmp_path: Path) -> None:
    opens_s = 15.0
    out_of_it = (CABIN_XY, (12.0, 7.5), (24.0, 7.5), (24.0, 12.5))
    driven = drive(OLD.with_elevator_closed(opens_s), out_of_it, day=1, wait_s=opens_s + 2.0)
    result = localised(mapped, driven, tmp_path)
    assert_nothing_false(result)
    assert result.states[-1] == "TRACKING", result.reasons
    assert result.report["localization"]["found_after_s"] > opens_s


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> Mapped:
    return map_of(drive(twin_halls(), TWIN_ROUTE, day=0), tmp_path_factory.mktemp("twins"))


@pytest.mark.xfail(reason="claims the other hall: the search keeps one of two places that fit alike")
def test_of_two_halls_that_look_alike_none_is_claimed_by_the_laser_alone(twins: Mapped, tmp_path: Path) -> None:
    inside = ((33.0, 3.0), (38.0, 3.0), (38.0, 7.0), (33.0, 7.0), (33.0, 3.0), (38.0, 3.0))
    result = localised(twins, drive(twin_halls(), inside, day=1, robot=Robot(wifi=False)), tmp_path)
    assert_nothing_false(result)
    assert "ambiguous" in result.categories
    assert "look alike" in result.reasons


def test_of_two_halls_that_look_alike_wifi_tells_which(twins: Mapped, tmp_path: Path) -> None:
    inside = ((33.0, 3.0), (38.0, 3.0), (38.0, 7.0), (33.0, 7.0), (33.0, 3.0), (38.0, 3.0))
    result = localised(twins, drive(twin_halls(), inside, day=1), tmp_path)
    assert_nothing_false(result)
    assert result.states[-1] == "TRACKING", result.reasons


@pytest.mark.xfail(reason="claims are 3.6 m off at the median in this small building, 3 m are wanted")
def test_without_a_laser_it_is_found_more_coarsely(mapped: Mapped, tmp_path: Path) -> None:
    there_and_back = (*WAY, (9.0, 2.5), (9.0, 7.5), (2.0, 7.5), (20.0, 7.5))
    result = localised(mapped, drive(OLD, there_and_back, day=1, robot=Robot(mount=None)), tmp_path)
    assert len(result.errors_m) > 0, result.reasons
    assert np.median(result.errors_m) < 3.0
    assert result.errors_m.max() < 6.0


def test_with_neither_laser_nor_wifi_it_says_that_nothing_tells_where_it_is(mapped: Mapped, tmp_path: Path) -> None:
    result = localised(mapped, drive(OLD, WAY, day=1, robot=Robot(mount=None, wifi=False)), tmp_path)
    assert len(result.errors_m) == 0
    assert "no_sensor" in result.categories, result.reasons
