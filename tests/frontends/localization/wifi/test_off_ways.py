"""How far off the ways of a map a robot is by WiFi's levels, and how much the levels of a map differ."""

import numpy as np
import pytest
from building_maps.radio import STEP_M, Radio, drive, radio, radio_map, round_way

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.localization.wifi.belief_config import LikelihoodConfig, WifiBeliefConfig
from wayfi.frontends.localization.wifi.clusters import PlaceBelief
from wayfi.frontends.localization.wifi.off_ways import Away, OffWays
from wayfi.frontends.localization.wifi.radio_places import RadioPlaces, radio_places
from wayfi.frontends.localization.wifi_belief import WifiBelief

CONFIG = LikelihoodConfig()
WAY = round_way()
MIDDLE = 60  # a pose half way along the first corridor, 30 m from its end
SCANS = 8


@pytest.fixture(scope="module")
def places() -> RadioPlaces:
    found = radio_places(radio_map(radio(), WAY), CONFIG)
    assert found is not None
    return found


def away(places: RadioPlaces, off_m: float, heard: Radio | None = None, seed: int = 5) -> Away:
    """By scans `off_m` outside of the middle of the first corridor, while WiFi names the middle."""
    off_ways, chance = OffWays(places, CONFIG), np.random.default_rng(seed)
    named = PlaceBelief(Pose2.of(WAY[MIDDLE]), np.eye(3), 1.0)
    for _ in range(SCANS):
        off_ways.add((heard or radio()).readings(WAY[MIDDLE, :2] + [0.0, -off_m], chance), named)
    return off_ways.away


@pytest.mark.parametrize("fading_db", [1.0, 2.0, 3.0])
def test_the_spread_of_a_map_is_learnt_from_its_fingerprints(fading_db: float) -> None:
    chance = np.random.default_rng(3)
    building = radio_map(radio(), WAY)
    for f, pose in zip(building.fingerprints, WAY, strict=True):
        object.__setattr__(f, "readings", radio().readings(pose[:2], chance, fading_db))
    places = radio_places(building, CONFIG)

    assert places is not None
    assert places.fingerprinted.spread.level_db == pytest.approx(np.hypot(fading_db, CONFIG.day_db), rel=0.15)
    assert 0.5 < places.fingerprinted.spread.gradient_db_per_m < 1.5


def test_a_map_with_fingerprints_far_apart_does_not_tell_its_spread() -> None:
    places = radio_places(radio_map(radio(), WAY[:: round(3.0 / STEP_M)]), CONFIG)

    assert places is not None
    assert places.fingerprinted.spread == (CONFIG.level_db, CONFIG.gradient_db_per_m)


@pytest.mark.parametrize("seed", range(4))
def test_on_the_ways_levels_fit(places: RadioPlaces, seed: int) -> None:
    assert away(places, 0.0, seed=seed).by_levels_m <= 1.0


@pytest.mark.parametrize("seed", range(4))
def test_with_a_third_of_the_access_points_moved_levels_fit_as_well(places: RadioPlaces, seed: int) -> None:
    assert away(places, 0.0, radio().moved(0.3, seed)).by_levels_m <= 1.0


@pytest.mark.parametrize("off_m", [4.0, 5.0, 6.0])
def test_beside_the_ways_levels_tell_the_distance(places: RadioPlaces, off_m: float) -> None:
    found = away(places, off_m)

    assert found.by_levels_m == pytest.approx(off_m, rel=0.25)
    assert found.unexplained_m == pytest.approx(found.metres, abs=0.1)


def test_a_place_off_the_ways_explains_levels_that_differ() -> None:
    assert Away(by_levels_m=5.0, named_m=4.0).unexplained_m == 3.0
    assert Away(by_levels_m=2.0, named_m=4.0).unexplained_m == 0.0
    assert Away(by_levels_m=2.0, named_m=4.0).metres == 4.0


def test_scans_that_have_little_in_common_with_the_map_say_nothing(places: RadioPlaces) -> None:
    assert away(places, 9.0, radio(mac=5000)) == Away()


def way_off() -> Floats:
    """Along the first corridor, and then straight away from it."""
    beside = [(WAY[MIDDLE, 0], -STEP_M * k, -np.pi / 2) for k in range(1, 30)]
    return np.vstack([WAY[MIDDLE - 30 : MIDDLE], np.array(beside)])


def test_a_belief_tells_that_the_robot_leaves_the_ways() -> None:
    belief, way = WifiBelief(radio_map(radio(), WAY), WifiBeliefConfig()), way_off()
    assert belief.away == Away()
    drive(belief, radio(), way[:30])
    assert belief.away.metres < 1.5
    drive(belief, radio(), way[29:], start=False)
    assert belief.away.metres > 4.0
