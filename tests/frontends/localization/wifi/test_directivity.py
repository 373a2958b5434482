"""Receivers that hear more of what is ahead: learnt from a map, and taken into account where they are."""

from dataclasses import replace

import numpy as np
import pytest
from building_maps.radio import Radio, drive, radio, radio_map, round_way

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.localization.wifi.belief_config import LikelihoodConfig, WifiBeliefConfig
from wayfi.frontends.localization.wifi.radio_places import RadioPlaces, radio_places
from wayfi.frontends.localization.wifi_belief import WifiBelief

WAY = round_way()
CORRIDOR = slice(0, 120)  # of the way, which is driven both ways
OPPOSITE = slice(185, 295)  # of the way: a corridor that the map knows by one heading
AHEAD_DB = 2.5


def backwards(way: Floats) -> Floats:
    return np.column_stack([way[::-1, :2], way[::-1, 2] + np.pi])


MAPPED = np.vstack([WAY, backwards(WAY[CORRIDOR])])


def directed(ahead_db: float) -> Radio:
    return replace(radio(), ahead_db=ahead_db)


def places(heard: Radio, way: Floats) -> RadioPlaces:
    found = radio_places(radio_map(heard, way), LikelihoodConfig())
    assert found is not None
    return found


@pytest.mark.parametrize("ahead_db", [1.5, AHEAD_DB, -2.0])
def test_a_gain_is_learnt_from_places_that_were_passed_both_ways(ahead_db: float) -> None:
    ahead, left = places(directed(ahead_db), MAPPED).fingerprinted.gains["phone"]

    assert ahead == pytest.approx(ahead_db, abs=0.4)
    assert abs(left) < 0.4


def test_a_receiver_that_hears_alike_all_around_has_no_gain() -> None:
    assert places(directed(0.0), MAPPED).fingerprinted.gains == {}


def test_a_way_that_was_driven_one_way_alone_tells_no_gain() -> None:
    assert places(directed(AHEAD_DB), WAY[CORRIDOR]).fingerprinted.gains == {}


def test_access_points_are_seen_in_their_directions() -> None:
    heard = directed(0.0)
    known = places(heard, MAPPED)
    numbered = known.fingerprinted.numbers
    numbers = [numbered[b] for b in heard.bssids if b in numbered]
    stand = dict(
        zip(numbers, [xy for b, xy in zip(heard.bssids, heard.places, strict=True) if b in numbered], strict=True)
    )
    away = np.array([stand[a] for a in known.heard.aps.tolist()]) - known.xy[known.heard.rows()]
    distance_m = np.hypot(*away.T)
    far = distance_m > 5.0
    cosine = (known.towards[far] * away[far] / distance_m[far, None]).sum(axis=1)

    assert np.median(cosine) > 0.9
    assert np.hypot(*known.towards.T).max() <= 1.0 + 1e-6


def test_who_comes_the_other_way_is_not_taken_to_be_further_on() -> None:
    way, heard = backwards(WAY[OPPOSITE]), directed(AHEAD_DB)
    building, ahead_m = radio_map(heard, MAPPED), []
    for first in range(0, 70, 7):
        belief, driven = WifiBelief(building, WifiBeliefConfig()), way[first : first + 30]
        drive(belief, heard, driven, seed=first)
        ahead_m.append(Pose2.of(driven[-1]).between(belief.places(1)[0].T_map_base).x)

    assert abs(np.mean(ahead_m)) < 1.1  # 2.6 for a receiver that is taken to hear alike all around
