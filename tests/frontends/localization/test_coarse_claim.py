"""What WiFi and wheels alone may claim."""

import numpy as np
import pytest
from building_maps.radio import STEP_COVARIANCE, Radio, radio, radio_map, round_way

from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.localization.coarse_claim import CoarseClaim
from wayfi.frontends.localization.wifi.belief_config import CoarseClaimConfig, WifiBeliefConfig
from wayfi.frontends.localization.wifi.clusters import PlaceBelief
from wayfi.frontends.localization.wifi.off_ways import Away
from wayfi.frontends.localization.wifi_belief import WifiBelief
from wayfi.frontends.maps.building_map import BuildingMap

CONFIG = CoarseClaimConfig()
WAY = round_way()
SURE = PlaceBelief(Pose2(1.0, 2.0, 0.3), np.diag([1.0, 1.0, 0.1]), 0.97)
WIDE = PlaceBelief(Pose2(1.0, 2.0, 0.3), np.diag([20.0, 1.0, 0.1]), 0.97)
TURNED = PlaceBelief(Pose2(1.0, 2.0, 0.3), np.diag([1.0, 1.0, 3.3]), 0.97)
LIGHT = PlaceBelief(Pose2(1.0, 2.0, 0.3), np.diag([1.0, 1.0, 0.1]), 0.3)


@pytest.fixture(scope="module")
def building() -> BuildingMap:
    return radio_map(radio(), WAY)


def judged(*places: PlaceBelief | None) -> CoarseClaim:
    """A claim after a robot has found `places` half a metre apart."""
    claim = CoarseClaim(CONFIG)
    for k, place in enumerate(places):
        claim.judge([] if place is None else [place], 0.5 * k)
    return claim


def states_along(building: BuildingMap, heard: Radio, way: Floats) -> list[tuple[State, float]]:
    """The state at each pose of a drive, and how far the claim is from the truth, m."""
    belief, claim, chance = WifiBelief(building, WifiBeliefConfig()), CoarseClaim(CONFIG), np.random.default_rng(4)
    states = []
    for k, pose in enumerate(way):
        if k:
            belief.move(Pose2.of(way[k - 1]).between(Pose2.of(pose)), STEP_COVARIANCE)
        belief.add("phone", heard.readings(pose[:2], chance))
        claim.judge(belief.places(4), 0.5 * k)
        apart_m = claim.claimed.T_map_base.distance(Pose2.of(pose)) if claim.claimed else np.inf
        states.append((claim.health.state, apart_m))
    return states


def test_a_place_is_claimed_only_after_some_metres() -> None:
    assert judged(*[SURE] * 4).health.state is State.RELOCALISING
    assert judged(*[SURE] * 5).health.state is State.TRACKING


@pytest.mark.parametrize("unsure", [WIDE, TURNED, LIGHT, None])
def test_what_is_wide_open_or_light_is_not_claimed(unsure: PlaceBelief | None) -> None:
    assert judged(*[unsure] * 20).claimed is None
    assert judged(*[SURE] * 3, unsure, *[SURE] * 3).claimed is None


@pytest.mark.parametrize("unsure", [WIDE, TURNED, LIGHT])
def test_a_claim_becomes_uncertain_and_is_given_up_after_some_metres(unsure: PlaceBelief) -> None:
    assert judged(*[SURE] * 5, unsure).health.state is State.UNCERTAIN
    assert judged(*[SURE] * 5, unsure, unsure, SURE).health.state is State.TRACKING
    assert judged(*[SURE] * 5, *[unsure] * 5).health.state is State.LOST


OFF_WAYS = Away(by_levels_m=4.0, named_m=0.0)
EXPLAINED = Away(by_levels_m=4.0, named_m=4.0)


@pytest.mark.parametrize("away", [OFF_WAYS, EXPLAINED])
def test_off_the_ways_of_the_map_no_place_is_confirmed(away: Away) -> None:
    claim = CoarseClaim(CONFIG)
    for k in range(20):
        claim.judge([SURE], 0.5 * k, away)
    assert claim.claimed is None


def test_a_claim_is_kept_off_the_ways_while_levels_agree_and_doubted_as_they_do_not() -> None:
    claim = judged(*[SURE] * 5)
    claim.judge([SURE], 2.5, EXPLAINED)
    assert claim.health.state is State.TRACKING
    claim.judge([SURE], 3.0, OFF_WAYS)
    assert claim.health.state is State.UNCERTAIN
    assert claim.claimed is not None
    assert claim.claimed.sigma_m > 4.0
    assert "4 m off the ways of the map" in claim.health.reason
    for k in range(4):
        claim.judge([SURE], 3.5 + 0.5 * k, OFF_WAYS)
    assert claim.health.state is State.LOST


def test_a_claim_is_given_up_at_once_where_no_place_is_left() -> None:
    claim = judged(*[SURE] * 5, None)

    assert claim.health.state is State.LOST
    assert claim.claimed is None


@pytest.mark.parametrize("first", [20, 110, 200, 290])
def test_a_robot_without_a_laser_is_found_within_fifteen_metres(building: BuildingMap, first: int) -> None:
    states = states_along(building, radio(), np.vstack([WAY, WAY])[first : first + 60])

    assert all(state is State.TRACKING and apart_m < 3.0 for state, apart_m in states[30:])
    assert all(apart_m < 3.0 for state, apart_m in states if state is State.TRACKING)


@pytest.mark.parametrize("seed", range(20, 24))
def test_nothing_is_claimed_in_another_building(building: BuildingMap, seed: int) -> None:
    states = states_along(building, radio(seed=seed), WAY[40:120])

    assert not any(state is State.TRACKING for state, _ in states)
