"""Which access points have weight: those whose RSSI tells the place, on drives whose radio is known."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from wayfi.frontends.wifi.access_points import AccessPoints
from wayfi.frontends.wifi.fingerprint_index import FingerprintIndex
from wayfi.frontends.wifi.readings import Readings
from wayfi.frontends.wifi.wifi_config import AccessPointConfig

Floats = NDArray[np.float64]

CONFIG = AccessPointConfig()
SIGMA_DB = 6.0
STEP_M, LAP_M, LAPS = 0.5, 80.0, 3
PER_LAP = int(LAP_M / STEP_M)
FIXED = 30
HEARD_DBM = -85.0


def bssid(number: int) -> str:
    return f"02:00:00:00:{number >> 8:02x}:{number & 255:02x}"


def drive(laps: int = LAPS) -> Floats:
    """(n, 2) m: round and round a hall of 30 x 10 m."""
    along = np.arange(0.0, laps * LAP_M, STEP_M) % LAP_M
    x = np.interp(along, [0, 30, 40, 70, 80], [0, 30, 30, 0, 0])
    return np.column_stack([x, np.interp(along, [0, 30, 40, 70, 80], [0, 0, 10, 10, 0])])


def fixed(places: Floats, rng: np.random.Generator) -> Floats:
    """(n, FIXED) dBm of access points in and around the hall."""
    where = rng.uniform((-20.0, -20.0), (50.0, 30.0), (FIXED, 2))
    return faded(np.hypot(*(places[:, None] - where).transpose(2, 0, 1)), rng)


def faded(distance: Floats, rng: np.random.Generator) -> Floats:
    return -40.0 - 35.0 * np.log10(np.maximum(distance, 1.0)) + rng.normal(0.0, 2.0, distance.shape)


def readings(rssi: Floats) -> Readings:
    """One fingerprint of the (a,) levels of access points 0, 1, ...; NaN and what is weak is not heard."""
    heard = np.flatnonzero(rssi > HEARD_DBM)
    return Readings(tuple(bssid(n) for n in heard), rssi[heard].astype(np.float32), np.zeros(len(heard), np.float32))


class WatchedIndex(FingerprintIndex):
    """An index that tells the weights given to its access points."""

    def __init__(self) -> None:
        super().__init__(SIGMA_DB)
        self._bssids: list[str] = []
        self.weights: dict[str, float] = {}

    def add(self, readings: Readings) -> int:
        self._bssids += [b for b in readings.bssids if b not in self._bssids]
        return super().add(readings)

    def weigh(self, aps: NDArray[np.int32], weights: Floats) -> None:
        super().weigh(aps, weights)
        self.weights |= {self._bssids[ap]: float(w) for ap, w in zip(aps, weights, strict=True)}

    def weight(self, number: int) -> float:
        return self.weights[bssid(number)]

    def typical(self) -> float:
        """The weight of a fixed access point."""
        return float(np.median([self.weight(n) for n in range(FIXED) if bssid(n) in self.weights]))


def learn(rssi: Floats, confirm: Callable[[int], int | None] = lambda _: None) -> WatchedIndex:
    """Drive with (n, a) dBm heard; `confirm` names the earlier fingerprint that is found to be of the same place."""
    index = WatchedIndex()
    access_points = AccessPoints(index, CONFIG)
    for number, here in enumerate(rssi):
        index.add(readings(here))
        access_points.learn(number * STEP_M)
        if (earlier := confirm(number)) is not None:
            access_points.confirm(earlier, number)
    return index


def lap_before(number: int) -> int | None:
    return number - PER_LAP if number >= PER_LAP else None


def with_one_more(rssi: Floats, more: Floats) -> Floats:
    return np.column_stack([rssi, more])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_a_hotspot_on_the_robot_has_no_vote(rng: np.random.Generator) -> None:
    rssi = fixed(drive(), rng)
    learnt = learn(with_one_more(rssi, rng.normal(-45.0, 2.0, len(rssi))))
    assert learnt.weight(FIXED) < 0.05
    assert learnt.typical() > 0.3


def test_one_that_is_heard_by_chance_has_no_vote(rng: np.random.Generator) -> None:
    rssi = fixed(drive(), rng)
    by_chance = np.where(rng.random(len(rssi)) < 0.1, rng.uniform(-80.0, -50.0, len(rssi)), np.nan)
    learnt = learn(with_one_more(rssi, by_chance))
    assert learnt.weight(FIXED) < 0.3 * learnt.typical()


def test_one_that_moved_loses_its_weight_where_places_are_revisited(rng: np.random.Generator) -> None:
    places = drive()
    rssi = fixed(places, rng)
    moved_to = np.where(np.arange(len(places))[:, None] < PER_LAP, (5.0, 5.0), (25.0, 5.0))
    rssi = with_one_more(rssi, faded(np.hypot(*(places - moved_to).T), rng) + 10.0)
    passing, revisiting = learn(rssi), learn(rssi[: 2 * PER_LAP], lap_before)
    assert passing.weight(FIXED) > 0.5 * passing.typical()
    assert revisiting.weight(FIXED) < 0.5 * passing.weight(FIXED)
    assert revisiting.typical() > 0.8 * passing.typical()


def test_one_that_is_gone_loses_its_weight_where_places_are_revisited(rng: np.random.Generator) -> None:
    places = drive(2)
    gone = np.where(np.arange(len(places)) < PER_LAP, faded(np.hypot(*(places - (15.0, 5.0)).T), rng) + 10.0, np.nan)
    rssi = with_one_more(fixed(places, rng), gone)
    assert learn(rssi, lap_before).weight(FIXED) < 0.5 * learn(rssi).weight(FIXED)


def test_revisits_do_not_cost_one_that_stays_its_weight(rng: np.random.Generator) -> None:
    rssi = fixed(drive(), rng)
    passing, revisiting = learn(rssi), learn(rssi, lap_before)
    assert revisiting.typical() > 0.8 * passing.typical()


def test_one_that_is_carried_from_some_day_on_loses_its_weight_then(rng: np.random.Generator) -> None:
    places = drive(8)
    early = np.arange(len(places)) < 2 * PER_LAP
    later_carried = np.where(early, faded(np.hypot(*(places - (15.0, 5.0)).T), rng) + 10.0, -45.0)
    rssi = with_one_more(fixed(places, rng), later_carried)
    assert learn(rssi[: 2 * PER_LAP]).weight(FIXED) > 0.25
    assert learn(rssi).weight(FIXED) < 0.1


def test_a_robot_that_stands_still_learns_nothing(rng: np.random.Generator) -> None:
    driven = fixed(drive(1), rng)
    rssi = np.vstack([driven, driven[-1] + rng.normal(0.0, 0.1, (300, FIXED))])
    index = WatchedIndex()
    access_points = AccessPoints(index, CONFIG)
    for number, here in enumerate(rssi):
        index.add(readings(here))
        access_points.learn(min(number, PER_LAP - 1) * STEP_M)
        if number == PER_LAP - 1:
            before = dict(index.weights)
    assert {b: w for b, w in index.weights.items() if b in before} == before


def test_every_access_point_has_a_weight_as_soon_as_it_is_heard() -> None:
    learnt = learn(np.array([[-50.0, np.nan], [np.nan, -50.0]]))
    assert sorted(learnt.weights) == [bssid(0), bssid(1)]
    assert all(CONFIG.min_weight < weight < 1.0 for weight in learnt.weights.values())


def test_a_path_that_falls_back_a_little_does_no_harm(rng: np.random.Generator) -> None:
    """Two receivers complete their fingerprints in turn, not in the order of the path."""
    index = WatchedIndex()
    access_points = AccessPoints(index, CONFIG)
    for number, here in enumerate(fixed(drive(), rng)):
        index.add(readings(here))
        access_points.learn(max(0.0, number * STEP_M - (1.2 if number % 2 else 0.0)))
    assert 0.3 < index.typical() < 1.0


def test_places_are_found_among_hotspots_that_travel_along(rng: np.random.Generator) -> None:
    """With about as many hotspots on the robot as access points are heard."""
    places = drive(2)
    carried = rng.normal(rng.uniform(-70.0, -40.0, 15), 3.0, (len(places), 15))
    carried[rng.random(carried.shape) < 0.3] = np.nan
    rssi = np.column_stack([fixed(places, rng), carried])
    weighted, plain = learn(rssi), FingerprintIndex(SIGMA_DB)
    for here in rssi:
        plain.add(readings(here))
    assert missed(weighted, places) < 0.6 * missed(plain, places)


def missed(index: FingerprintIndex, places: Floats) -> float:
    """The share of the second lap's fingerprints whose most similar one is not within 3 m."""
    best = [int(index.similar(n, n - 60).numbers[0]) for n in range(PER_LAP + 60, len(places))]
    return float(np.mean(np.hypot(*(places[best] - places[PER_LAP + 60 :]).T) >= 3.0))
