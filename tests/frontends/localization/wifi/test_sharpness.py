"""How much a scan counts between places of a map: as much as the map's own scans bear, which may err together."""

from dataclasses import replace

import numpy as np
import pytest
from building_maps.radio import STEP_M, radio, radio_map, round_way

from wayfi.frontends.localization.wifi.belief_config import WifiBeliefConfig
from wayfi.frontends.localization.wifi.radio_places import radio_places
from wayfi.frontends.localization.wifi.sharpness import WAY_M, learn_sharpness
from wayfi.frontends.maps.building_map import BuildingMap

CONFIG = WifiBeliefConfig()


def sharpness(building: BuildingMap) -> float:
    places = radio_places(building, CONFIG.likelihood)
    assert places is not None
    return learn_sharpness(building, places, CONFIG)


def erring(building: BuildingMap, sigma_db: float, over_m: float, seed: int = 5) -> BuildingMap:
    """The map with an error of each access point's RSSI that is new after `over_m` of path."""
    chance = np.random.default_rng(seed)
    errors: dict[tuple[str, int], float] = {}
    fingerprints = []
    for f in building.fingerprints:
        keys = [(bssid, int(f.path_m // over_m)) for bssid in f.readings.bssids]
        error = np.array([errors.setdefault(key, chance.normal(0.0, sigma_db)) for key in keys], np.float32)
        fingerprints.append(replace(f, readings=replace(f.readings, rssi=f.readings.rssi + error)))
    return replace(building, fingerprints=fingerprints)


@pytest.fixture(scope="module")
def twice() -> BuildingMap:
    return radio_map(radio(), round_way(rounds=2.0))


def test_scans_that_err_together_count_less_than_scans_that_err_by_themselves(twice: BuildingMap) -> None:
    alone, together = (sharpness(erring(twice, 5.0, over_m)) for over_m in (STEP_M, WAY_M))

    assert together < 0.7 * alone


def test_the_worse_scans_repeat_the_less_they_count(twice: BuildingMap) -> None:
    powers = [sharpness(erring(twice, sigma_db, WAY_M)) for sigma_db in (2.0, 5.0, 10.0)]

    assert powers == sorted(powers, reverse=True)
    assert powers[2] < 0.6 * powers[0]


def test_a_map_of_ways_that_were_driven_once_tells_nothing() -> None:
    assert sharpness(radio_map(radio(), round_way())) == CONFIG.within_map
