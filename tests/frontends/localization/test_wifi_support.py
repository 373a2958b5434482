"""What WiFi says of poses near the places that it names, and of those that are turned there."""

import math

import numpy as np
import pytest

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.localization.claims import why_not_confirmed
from wayfi.frontends.localization.cluster import Cluster
from wayfi.frontends.localization.hypotheses import Hypothesis
from wayfi.frontends.localization.localization_config import ClaimConfig
from wayfi.frontends.localization.wifi.clusters import OPEN_RAD2, PlaceBelief
from wayfi.frontends.localization.wifi.particles import Cloud
from wayfi.frontends.localization.wifi_support import WifiSupport


def cloud(at: Pose2, sigma_m: float, sigma_rad: float, weight: float = 1.0) -> Cloud:
    """1,000 poses around one."""
    spread = np.random.default_rng(1).normal(0.0, (sigma_m, sigma_m, sigma_rad), (1000, 3))
    return Cloud(at.array() + spread, np.zeros(1000, np.int64), np.full(1000, weight / 1000))


def support(variance_rad2: float) -> WifiSupport:
    at = Pose2(3.0, 4.0, 0.2)
    place = PlaceBelief(at, np.diag([1.0, 1.0, variance_rad2]), 0.9)
    return WifiSupport([place], cloud(at, 0.7, math.sqrt(variance_rad2), 0.9))


def test_a_cloud_that_fills_one_aisle_says_nothing_for_the_next_one() -> None:
    at = Pose2(3.0, 4.0, 0.2)
    flat = np.column_stack([np.linspace(1.0, 5.0, 1000), np.full(1000, 4.0), np.full(1000, 0.2)])
    filled = Cloud(flat, np.zeros(1000, np.int64), np.full(1000, 1e-3))
    heard = WifiSupport([PlaceBelief(at, np.diag([1.33, 0.3, 0.1]), 1.0)], filled)
    assert heard.nats(Pose2(4.5, 4.0, 0.2), 0) > -0.5
    assert heard.nats(Pose2(7.3, 4.0, 0.2), 0) < -5.0
    assert heard.nats(at, 1) == -12.0


def test_a_pose_turned_round_is_unlikely_where_the_heading_is_known() -> None:
    known = support(0.04)
    assert known.nats(Pose2(3.0, 4.0, 0.2), 0) == 0.0
    assert -6.0 < known.nats(Pose2(3.0, 4.0, 0.2 + math.pi), 0) < -4.0
    assert known.nats(Pose2(3.0, 4.0, 0.2 - 2 * math.pi + 0.1), 0) > -0.1


def test_a_pose_off_a_place_that_is_known_well_is_unlikely() -> None:
    at = Pose2(3.0, 4.0, 0.2)
    sharp = WifiSupport([PlaceBelief(at, np.diag([0.35, 0.35, 0.01]), 1.0)], cloud(at, 0.35, 0.1))

    assert sharp.nats(Pose2(3.4, 4.0, 0.2), 0) > -1.0
    assert sharp.nats(Pose2(4.5, 4.0, 0.2), 0) < -3.0
    assert sharp.nats(Pose2(5.3, 4.0, 0.2), 0) > -12.0  # WiFi errs beyond its belief at times


def test_every_heading_is_about_as_likely_where_it_is_open() -> None:
    assert support(OPEN_RAD2).nats(Pose2(3.0, 4.0, 0.2 + math.pi), 0) > -1.5


def test_a_pose_some_metres_off_is_unlikely_whatever_its_heading() -> None:
    assert support(OPEN_RAD2).nats(Pose2(9.0, 4.0, 0.2), 0) < -8.0


@pytest.mark.parametrize(
    ("wifi", "agreed", "all_agreed", "along_m", "confirmed"),
    [
        (True, 2, True, 1.0, True),
        (True, 2, True, 0.5, False),
        (True, 2, False, 1.0, False),
        (True, 3, False, 1.0, True),
        (False, 3, True, 1.5, False),
        (False, 4, True, 1.5, True),
    ],
)
def test_fewer_scans_confirm_a_place_that_wifi_names_as_well(
    wifi: bool, agreed: int, all_agreed: bool, along_m: float, confirmed: bool
) -> None:
    covariance = 1e-3 * np.eye(3)
    at = Hypothesis(Pose2(3.0, 4.0, 0.2), covariance, 5, agreed=agreed, all_agreed=all_agreed, agreed_to_m=along_m)
    cluster = Cluster(at, 5, at.T_map_base, at.covariance, gain=10.0, rivals=0, proposed=1)
    heard = support(0.04) if wifi else WifiSupport(())
    assert (why_not_confirmed(cluster, heard, True, ClaimConfig()) is None) == confirmed


@pytest.mark.parametrize(
    ("off_m", "turned_rad", "confirmed"), [(1.8, 0.0, True), (3.0, 0.0, False), (0.0, math.pi, False)]
)
def test_wifi_may_err_beyond_its_belief_but_not_by_metres_or_half_a_turn(
    off_m: float, turned_rad: float, confirmed: bool
) -> None:
    named = Pose2(3.0, 4.0, 0.2)
    heard = WifiSupport([PlaceBelief(named, np.diag([0.2, 0.2, 0.04]), 1.0)], cloud(named, 0.3, 0.2))
    T = Pose2(named.x + off_m, named.y, named.theta + turned_rad)
    at = Hypothesis(T, 1e-3 * np.eye(3), 5, agreed=4, agreed_to_m=1.5)
    cluster = Cluster(at, 5, T, at.covariance, gain=10.0, rivals=0, proposed=1)
    assert (why_not_confirmed(cluster, heard, True, ClaimConfig()) is None) == confirmed


@pytest.mark.parametrize(("wifi", "turned", "confirmed"), [(True, 1.0, True), (True, 0.5, False), (False, 3.0, False)])
def test_turns_on_the_spot_confirm_a_place_that_wifi_names_as_well(wifi: bool, turned: float, confirmed: bool) -> None:
    at = Hypothesis(Pose2(3.0, 4.0, 0.2), 1e-3 * np.eye(3), 5, agreed=4, agreed_rad=turned)
    cluster = Cluster(at, 5, at.T_map_base, at.covariance, gain=10.0, rivals=0, proposed=1)
    heard = support(0.04) if wifi else WifiSupport(())
    assert (why_not_confirmed(cluster, heard, True, ClaimConfig()) is None) == confirmed


@pytest.mark.parametrize(
    ("wifi", "along_m", "confirmed"),
    [(True, 2.5, False), (True, 3.5, True), (False, 3.5, False), (False, 5.5, True)],
)
def test_between_walls_that_leave_the_place_open_a_longer_way_has_to_agree(
    wifi: bool, along_m: float, confirmed: bool
) -> None:
    at = Hypothesis(Pose2(3.0, 4.0, 0.2), np.diag([0.5, 1e-3, 1e-3]), 5, agreed=6, agreed_to_m=along_m)
    cluster = Cluster(at, 5, at.T_map_base, at.covariance, gain=10.0, rivals=0, proposed=1)
    assert (
        why_not_confirmed(cluster, support(0.04) if wifi else WifiSupport(()), True, ClaimConfig()) is None
    ) == confirmed


@pytest.mark.parametrize(
    ("wifi", "quality", "confirmed"), [(True, 0.65, True), (True, 0.55, False), (False, 0.8, False), (False, 0.9, True)]
)
def test_scans_may_fit_the_map_less_well_where_wifi_names_the_place(
    wifi: bool, quality: float, confirmed: bool
) -> None:
    at = Hypothesis(Pose2(3.0, 4.0, 0.2), 1e-3 * np.eye(3), 5, quality=quality, agreed=4, agreed_to_m=1.5)
    cluster = Cluster(at, 5, at.T_map_base, at.covariance, gain=10.0, rivals=0, proposed=1)
    heard = support(0.04) if wifi else WifiSupport(())
    assert (why_not_confirmed(cluster, heard, True, ClaimConfig()) is None) == confirmed
