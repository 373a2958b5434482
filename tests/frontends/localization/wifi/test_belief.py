"""What WiFi says of the place: in sound maps, for receivers that differ, and after access points were changed."""

import time
from dataclasses import replace

import numpy as np
import pytest
from building_maps.radio import Radio, drive, joined, radio, radio_map, round_way, serpentine_way

from wayfi.backend.pose2 import Pose2, compose_all, wrap
from wayfi.frontends.localization.wifi.belief_config import WifiBeliefConfig
from wayfi.frontends.localization.wifi_belief import PlaceBelief, WifiBelief
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.wifi.readings import Readings

CONFIG = WifiBeliefConfig()
WAY = round_way()
AWAY = 150  # a pose of the way where nothing is special: 75 m along it, in the second corridor
STARTS = range(5, 320, 45)


@pytest.fixture(scope="module")
def building() -> BuildingMap:
    return radio_map(radio(), WAY)


def best(belief: WifiBelief) -> PlaceBelief:
    """The heaviest place."""
    return belief.places(1)[0]


def after(building: BuildingMap, heard: Radio, first: int, scans: int, **options: object) -> WifiBelief:
    """The belief after a drive from pose `first` of the way."""
    belief = WifiBelief(building, CONFIG)
    drive(belief, heard, WAY[first : first + scans], **options)  # type: ignore[arg-type]
    return belief


def apart_m(place: PlaceBelief, pose: np.ndarray) -> float:
    return place.T_map_base.distance(Pose2.of(pose))


def chance_elsewhere(belief: WifiBelief, T_map_base: Pose2, floor: int = 0) -> float:
    """The weight of the places that a pose is surely not in."""

    def is_there(place: PlaceBelief) -> bool:
        return place.floor == floor and place.T_map_base.distance(T_map_base) < CONFIG.near_m + 2.0 * place.sigma_m

    return sum(place.weight for place in belief.places(8) if not is_there(place))


@pytest.mark.parametrize("first", STARTS)
def test_one_scan_names_the_place_with_an_open_heading(building: BuildingMap, first: int) -> None:
    place = best(after(building, radio(), first, 1))

    assert apart_m(place, WAY[first]) < 3.0
    assert place.weight > 0.3
    assert place.sigma_rad > 1.5


@pytest.mark.parametrize("first", STARTS)
def test_fifteen_metres_of_driving_tell_the_heading(building: BuildingMap, first: int) -> None:
    place = best(after(building, radio(), first, 30))

    assert apart_m(place, WAY[first + 29]) < 1.5
    assert abs(wrap(place.T_map_base.theta - WAY[first + 29, 2])) < 0.35
    assert place.sigma_rad < 0.5
    assert place.weight > 0.9


def test_true_places_are_within_the_stated_covariances(building: BuildingMap) -> None:
    chi2 = []
    for first in range(0, 320, 16):
        for scans in (1, 4, 20):
            place = best(after(building, radio(), first, scans, seed=first))
            e = np.array([place.T_map_base.x, place.T_map_base.y]) - WAY[first + scans - 1, :2]
            chi2.append(float(e @ np.linalg.solve(place.covariance[:2, :2], e)))

    assert np.mean(np.array(chi2) < 5.99) > 0.95  # the 95 % quantile of 2 degrees of freedom
    assert np.max(chi2) < 13.8  # the 99.9 % quantile


def test_it_says_the_same_each_time(building: BuildingMap) -> None:
    a, b = (after(building, radio(), AWAY, 12).places(4) for _ in range(2))

    assert [p.T_map_base for p in a] == [p.T_map_base for p in b]
    assert [p.weight for p in a] == [p.weight for p in b]


def test_a_map_that_is_turned_and_moved_turns_and_moves_the_places(building: BuildingMap) -> None:
    T = Pose2(300.0, -40.0, np.pi / 2)  # cells fall on cells
    turned = radio_map(radio(), WAY)
    object.__setattr__(turned, "poses", compose_all(T.array(), WAY))
    first, second = (best(after(m, radio(), AWAY, 30)) for m in (building, turned))

    assert (T @ first.T_map_base).distance(second.T_map_base) < 0.5
    assert abs(wrap((T @ first.T_map_base).theta - second.T_map_base.theta)) < 0.1


def test_weights_sum_to_one_at_most(building: BuildingMap) -> None:
    belief = after(building, radio(), AWAY, 3)
    weights = [place.weight for place in belief.places(100)]

    assert sum(weights) <= 1.0 + 1e-9
    assert weights == sorted(weights, reverse=True)


@pytest.mark.parametrize("offset_db", [-10.0, 8.0])
def test_a_phone_that_reads_stronger_or_weaker_is_found_as_well(building: BuildingMap, offset_db: float) -> None:
    def other_phone(readings: Readings) -> Readings:
        return Readings(readings.bssids, readings.rssi + np.float32(offset_db), readings.age_s)

    for first in STARTS:
        belief = after(building, radio(), first, 20, receiver="another", changes=[other_phone])
        assert apart_m(best(belief), WAY[first + 19]) < 2.0
        assert best(belief).weight > 0.9


def test_with_a_third_of_the_access_points_moved_it_is_found_as_well(building: BuildingMap) -> None:
    for first in STARTS:
        place = best(after(building, radio().moved(0.3, seed=first), first, 20))
        assert apart_m(place, WAY[first + 19]) < 3.0
        assert place.weight > 0.6


def test_what_counts_more_between_places_says_no_more_of_being_in_the_map(building: BuildingMap) -> None:
    def places(within_map: float) -> list[PlaceBelief]:
        belief = WifiBelief(building, replace(CONFIG, within_map=within_map))
        drive(belief, radio(), WAY[AWAY : AWAY + 1])
        return belief.places(1500)

    mild, sharp = places(1.0), places(2.0)
    assert sum(p.weight for p in sharp) == pytest.approx(sum(p.weight for p in mild), rel=1e-6)
    assert sharp[0].weight > 1.02 * mild[0].weight


def test_with_all_access_points_replaced_it_is_not_in_this_map(building: BuildingMap) -> None:
    belief = after(building, radio(mac=5000), AWAY, 20)

    assert sum(place.weight for place in belief.places(100)) < 0.1
    assert chance_elsewhere(belief, Pose2.of(WAY[0])) < 0.1


def test_one_old_access_point_among_new_ones_names_no_place(building: BuildingMap) -> None:
    old = radio()
    new = radio(seed=3, mac=5000)
    kept = Radio((old.bssids[7], *new.bssids[1:]), new.places, new.loss_db, new.waves, new.phases)

    assert sum(place.weight for place in after(building, kept, AWAY, 20).places(100)) < 0.2


def test_another_building_with_the_same_bssids_is_not_this_map(building: BuildingMap) -> None:
    for seed in range(3):
        belief = after(building, radio(seed=20 + seed), AWAY, 20)
        assert sum(place.weight for place in belief.places(100)) < 0.2


def test_hotspots_and_randomised_bssids_change_nothing_and_take_no_memory(building: BuildingMap) -> None:
    chance = np.random.default_rng(8)

    def crowd(readings: Readings) -> Readings:
        new = tuple(f"06:{':'.join(f'{n:02x}' for n in chance.integers(0, 256, 5))}" for _ in range(30))
        rssi = np.concatenate([readings.rssi, chance.uniform(-80, -40, 30).astype(np.float32)])
        return Readings(readings.bssids + new, rssi, np.zeros(len(rssi), np.float32))

    belief = after(building, radio(), AWAY, 20, changes=[crowd])
    assert apart_m(best(belief), WAY[AWAY + 19]) < 2.0
    assert best(belief).weight > 0.9


def test_a_map_without_wifi_says_nothing() -> None:
    belief = after(radio_map(None, WAY), radio(), AWAY, 5)

    assert belief.places(8) == []
    assert chance_elsewhere(belief, Pose2()) == 0.0


def test_nothing_is_said_before_a_scan(building: BuildingMap) -> None:
    belief = WifiBelief(building, CONFIG)
    belief.move(Pose2(1.0, 0.0, 0.0), np.eye(3))
    belief.add("phone", Readings((), np.empty(0, np.float32), np.empty(0, np.float32)))

    assert belief.places(8) == []


def test_wheels_that_are_not_numbers_are_passed_over(building: BuildingMap) -> None:
    belief = after(building, radio(), AWAY, 10)
    before = best(belief)
    belief.move(Pose2(np.nan, 0.0, 0.0), np.eye(3))
    belief.move(Pose2(), np.full((3, 3), np.inf))

    assert best(belief).T_map_base == before.T_map_base


def test_a_robot_that_was_carried_elsewhere_is_found_again(building: BuildingMap) -> None:
    belief = after(building, radio(), 20, 30)
    drive(belief, radio(), WAY[220:232], seed=5)

    assert apart_m(best(belief), WAY[231]) < 3.0
    assert best(belief).weight > 0.8


def test_a_pose_elsewhere_is_contradicted_within_some_scans(building: BuildingMap) -> None:
    belief = after(building, radio(), 20, 30)
    claimed = Pose2.of(WAY[49])
    assert chance_elsewhere(belief, claimed) < 0.05

    drive(belief, radio(), WAY[220:226], seed=5)

    assert chance_elsewhere(belief, claimed) > 0.9
    assert apart_m(best(belief), WAY[225]) < 4.0


def test_a_true_pose_is_not_contradicted_where_access_points_were_changed(building: BuildingMap) -> None:
    for seed in range(4):
        belief = WifiBelief(building, CONFIG)
        changed = radio().moved(0.3, seed)
        for k in range(10, 200, 10):
            drive(belief, changed, WAY[k : k + 11], seed=k, start=k == 10)
            assert chance_elsewhere(belief, Pose2.of(WAY[k + 10])) < 0.5


def test_another_floor_is_told_by_its_access_points() -> None:
    storeys = joined(radio_map(radio(), WAY), radio_map(radio(seed=9, mac=5000), WAY, floor=1))
    belief = after(storeys, radio(seed=9, mac=5000), AWAY, 10)

    assert best(belief).floor == 1
    assert chance_elsewhere(belief, Pose2.of(WAY[AWAY + 9]), floor=0) > 0.9
    assert chance_elsewhere(belief, Pose2.of(WAY[AWAY + 9]), floor=1) < 0.1


def test_standing_does_not_make_it_surer_than_driving() -> None:
    heard, way = radio(), np.tile(WAY[AWAY], (40, 1))
    standing = WifiBelief(radio_map(heard, WAY), CONFIG)
    drive(standing, heard, way)

    assert best(standing).sigma_rad > 1.5
    assert apart_m(best(standing), WAY[AWAY]) < 3.0


def test_the_cost_of_a_scan_is_bounded_in_a_large_map() -> None:
    whole, heard = serpentine_way(100.0, 2.0), radio(access_points=240, size_m=(100.0, 100.0))
    assert len(whole) == 10_000
    large, way = WifiBelief(radio_map(heard, whole), CONFIG), whole[4000:4010]
    drive(large, heard, way[:2])  # compiled by now
    began_s = time.process_time()
    drive(large, heard, way)
    each_s = (time.process_time() - began_s) / len(way)

    assert each_s < 0.05
    assert apart_m(best(large), way[-1]) < 3.0
