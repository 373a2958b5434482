"""The radio map of simulated halls: where access points stand, how sure that is, and which have no place."""

import numpy as np
import pytest
from building_maps.heard import heard_map, level_of, rounds

from wayfi.backend.pose2 import Floats
from wayfi.frontends.radio.radio_config import RadioConfig
from wayfi.frontends.radio.radio_map import AccessPoint, RadioError, RadioMap, Standing, radio_map

PLACES = rounds()
COUNT = 16


def bssid(k: int, last: int = 0) -> str:
    return f"a0:{7 * k % 256:02x}:{13 * k % 256:02x}:{29 * k % 256:02x}:{k:02x}:{last:02x}"


def mapped(levels: dict[str, Floats], xy: Floats = PLACES, offsets: dict[str, float] | None = None) -> RadioMap:
    return radio_map(heard_map(xy, levels, np.random.default_rng(5), offsets), RadioConfig())


def only(radio: RadioMap, name: str) -> AccessPoint:
    return next(ap for ap in radio.access_points if name in ap.bssids)


@pytest.fixture(scope="module")
def hall() -> tuple[RadioMap, dict[str, Floats]]:
    """A hall with access points inside and around it."""
    chance = np.random.default_rng(3)
    inside = chance.uniform([0, 0], [40, 20], (COUNT, 2))
    outside = chance.uniform([-25, -25], [-12, 45], (COUNT // 2, 2))
    truth = {bssid(k): place for k, place in enumerate([*inside, *outside])}
    return mapped({name: level_of(place.tolist(), PLACES, chance) for name, place in truth.items()}), truth


def test_access_points_inside_are_placed_to_within_4_m_and_all_covariances_are_honest(
    hall: tuple[RadioMap, dict[str, Floats]],
) -> None:
    radio, truth = hall
    errors, nees = {}, []
    for name, place in truth.items():
        ap = only(radio, name)
        assert ap.xy is not None
        assert ap.covariance is not None
        away = ap.xy - place
        errors[name] = float(np.hypot(*away))
        nees.append(float(away @ np.linalg.solve(ap.covariance, away)) / 2)
    assert np.median([errors[bssid(k)] for k in range(COUNT)]) < 4.0
    assert 0.1 < np.mean(nees) < 1.5


def test_an_access_point_outside_of_what_was_driven_is_badly_known_and_says_so(
    hall: tuple[RadioMap, dict[str, Floats]],
) -> None:
    sigma = [only(hall[0], name).sigmas_m for name in hall[1]]
    longest = np.array([each[0] for each in sigma if each])
    assert np.median(longest[COUNT:]) > 2.0 * np.median(longest[:COUNT])
    assert (longest[COUNT:] > 3.0).all()


def test_levels_are_true_to_their_sigma_where_the_robot_was_not() -> None:
    chance = np.random.default_rng(8)
    cells = np.stack(np.meshgrid(np.arange(0.5, 40), np.arange(0.5, 20)), axis=-1).reshape(-1, 2)
    everywhere = level_of([12.0, 7.0], np.vstack([PLACES, cells]), chance)
    radio = mapped({bssid(1): everywhere[: len(PLACES)]})
    ap, truth = only(radio, bssid(1)), dict(zip(map(tuple, cells.tolist()), everywhere[len(PLACES) :], strict=True))
    told = [
        (ap.level[k] - truth[at], ap.sigma[k])
        for k, at in enumerate(map(tuple, radio.cells.xy.tolist()))
        if at in truth
    ]
    error, sigma = np.array(told).T
    assert len(error) > 300
    assert np.sqrt(np.mean(error**2)) < 3.0
    assert 0.1 < np.mean((error / sigma) ** 2) < 1.5


def test_nothing_is_told_far_from_where_the_robot_was() -> None:
    radio = mapped({bssid(1): level_of([12.0, 7.0], PLACES, np.random.default_rng(8))})
    nearest = np.hypot(*(radio.cells.xy[:, None] - PLACES[None]).transpose(2, 0, 1)).min(axis=1)
    assert nearest.max() <= RadioConfig().reach_m + 2 * RadioConfig().cell_m


def test_where_nothing_was_heard_the_level_is_below_the_limit() -> None:
    radio = mapped({bssid(1): level_of([2.0, 2.0], PLACES, np.random.default_rng(2), power_dbm=-52.0)})
    ap = radio.access_points[0]
    far = radio.cells.xy[:, 0] > 20.0
    assert not (ap.level[far] > radio.limit_dbm + 3.0).any()
    assert np.nanmax(ap.level) > -70.0


def test_an_access_point_heard_once_has_no_position() -> None:
    once = np.full(len(PLACES), -200.0)
    once[5] = -60.0
    ap = only(mapped({bssid(1): once}), bssid(1))
    assert ap.standing is Standing.FEW
    assert ap.xy is None
    assert ap.sigmas_m is None
    assert np.count_nonzero(~np.isnan(ap.level)) > 0


def test_three_fingerprints_make_a_map_without_positions() -> None:
    xy = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    radio = mapped({bssid(1): np.full(3, -60.0), bssid(2): np.full(3, -70.0)}, xy)
    assert [ap.standing for ap in radio.access_points] == [Standing.FEW, Standing.FEW]
    assert not radio.holes().all()


def test_no_wifi_is_refused_in_a_line_that_says_what_to_do() -> None:
    with pytest.raises(RadioError, match=r"^no WiFi was heard on floor 0: drive there with a receiver, and map again$"):
        mapped({})
    with pytest.raises(RadioError, match="floor 3"):
        radio_map(
            heard_map(PLACES, {bssid(1): np.full(len(PLACES), -50.0)}, np.random.default_rng(0)), RadioConfig(), 3
        )


def test_one_that_was_moved_half_way_is_told_and_gets_no_position() -> None:
    chance = np.random.default_rng(4)
    first, second = (level_of(place, PLACES, chance) for place in ([4.0, 4.0], [36.0, 16.0]))
    moved = np.where(np.arange(len(PLACES)) < len(PLACES) // 2, first, second)
    radio = mapped({bssid(1): moved, bssid(2): first})
    assert only(radio, bssid(1)).standing is Standing.MOVED
    assert only(radio, bssid(1)).xy is None
    assert only(radio, bssid(2)).standing is Standing.STANDS


def test_a_hotspot_on_the_robot_has_no_position_and_covers_nothing() -> None:
    radio = mapped({bssid(1): np.full(len(PLACES), -42.0)})
    assert only(radio, bssid(1)).standing is Standing.CARRIED
    assert only(radio, bssid(1)).xy is None
    assert radio.holes().all()
    assert (radio.best()[0] == -1).all()


def test_one_far_away_that_is_level_everywhere_rides_on_no_robot() -> None:
    radio = mapped({bssid(1): level_of([-30.0, 10.0], PLACES, np.random.default_rng(6), power_dbm=-25.0)})
    ap = only(radio, bssid(1))
    assert ap.standing is Standing.STANDS
    assert ap.sigmas_m is not None
    assert ap.sigmas_m[0] > 8.0


def test_the_bssids_of_one_box_are_told_together_and_those_of_two_are_not() -> None:
    chance = np.random.default_rng(9)
    one, two = level_of([5.0, 5.0], PLACES, chance), level_of([30.0, 15.0], PLACES, chance)
    radio = mapped({bssid(1, 0): one, bssid(1, 1): one - 2.0, bssid(1, 2): two, "a2" + bssid(1, 3)[2:]: one})
    together = sorted(sorted(ap.bssids) for ap in radio.access_points)
    assert together == [sorted([bssid(1, 0), bssid(1, 1), "a2" + bssid(1, 3)[2:]]), [bssid(1, 2)]]


def test_levels_are_those_of_the_reference_receiver() -> None:
    level = level_of([5.0, 5.0], PLACES, np.random.default_rng(9))
    alike, apart = (mapped({bssid(1): level}, offsets=each) for each in ({"a": 0.0, "b": 0.0}, {"a": 0.0, "b": 9.0}))
    np.testing.assert_allclose(alike.access_points[0].level, apart.access_points[0].level, atol=0.01)


def test_holes_are_where_the_best_level_is_of_no_use() -> None:
    radio = mapped({bssid(1): level_of([0.0, 0.0], PLACES, np.random.default_rng(1), power_dbm=-45.0)})
    best, level, _ = radio.best()
    assert (best[~np.isnan(level)] == 0).all()
    np.testing.assert_array_equal(radio.holes(), ~(level >= RadioConfig().usable_dbm))
    assert 0.1 < radio.holes().mean() < 0.99
