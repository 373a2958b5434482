"""What receivers read above the first, found again in fingerprints that were made with known offsets."""

from collections.abc import Mapping

import numpy as np
import pytest

from wayfi.frontends.measurements import WifiScan
from wayfi.frontends.wifi.readings import Readings
from wayfi.frontends.wifi.receivers import ReceiverOffset, Receivers, stronger_differences
from wayfi.frontends.wifi.wifi_config import ReceiversConfig
from wayfi.recordings.simulation.run import start, wifi_scans
from wayfi.recordings.simulation.worlds.blueprints import World

CONFIG = ReceiversConfig()
FADING_DB, DETECTION_DBM = 3.0, -92.0


def readings(levels: Mapping[int, float]) -> Readings:
    rssi = np.array(list(levels.values()), np.float32)
    return Readings(tuple(f"02:00:00:00:00:{n:02x}" for n in levels), rssi, np.zeros(len(rssi), np.float32))


def heard(offset_db: float, rng: np.random.Generator, aps: int = 40) -> Readings:
    """A fingerprint of one place; what fades below the detection limit is not in it."""
    levels = np.linspace(-95.0, -50.0, aps) + offset_db + rng.normal(0.0, FADING_DB, aps)
    return readings({n: float(level) for n, level in enumerate(levels) if level > DETECTION_DBM})


def driven(offsets_db: Mapping[str, float], metres: int, seed: int) -> Receivers:
    """Learnt on a drive on which every receiver completes a fingerprint every metre, 0.2 m after the one before it."""
    rng, receivers = np.random.default_rng(seed), Receivers(CONFIG, {})
    for path_m in range(metres):
        for k, (receiver, offset_db) in enumerate(offsets_db.items()):
            receivers.learn(receiver, path_m + 0.2 * k, heard(offset_db, rng))
    return receivers


@pytest.mark.parametrize("apart_db", [-8.0, -3.0, 0.0, 2.0, 6.0])
def test_the_offset_of_a_second_receiver_is_found_though_it_misses_other_access_points(apart_db: float) -> None:
    """The limit of detection cuts off what it reads low: over all access points the median would be drawn towards 0."""
    found = driven({"a": 1.0, "b": 1.0 + apart_db}, 100, seed=0).offsets["b"]
    assert abs(found.offset_db - apart_db) < 0.5
    assert found.sigma_db < 0.5


def test_the_sigma_is_honest() -> None:
    found = [driven({"a": 0.0, "b": -4.0}, 15, seed).offsets["b"] for seed in range(40)]
    normalised = np.array([(offset.offset_db + 4.0) / offset.sigma_db for offset in found])
    assert 0.4 < np.sqrt(np.mean(normalised**2)) < 1.3


def test_the_first_receiver_is_the_reference() -> None:
    assert driven({"a": 5.0, "b": 2.0}, 20, seed=0).offsets["a"] == ReceiverOffset(0.0, 0.0)


def test_three_receivers_are_told_apart() -> None:
    offsets = driven({"a": 0.0, "b": 3.0, "c": -4.0}, 60, seed=1).offsets
    assert abs(offsets["b"].offset_db - 3.0) < 0.5
    assert abs(offsets["c"].offset_db + 4.0) < 0.5


def test_a_third_receiver_is_placed_by_the_second_where_it_never_meets_the_first() -> None:
    rng, receivers = np.random.default_rng(2), Receivers(CONFIG, {})
    for path_m in range(40):
        receivers.learn("a", path_m, heard(0.0, rng))
        receivers.learn("b", path_m + 0.2, heard(3.0, rng))
    for path_m in range(50, 90):
        receivers.learn("b", path_m, heard(3.0, rng))
        receivers.learn("c", path_m + 0.2, heard(-1.0, rng))
    assert abs(receivers.offsets["c"].offset_db + 1.0) < 0.8
    assert receivers.offsets["c"].sigma_db > receivers.offsets["b"].sigma_db


def test_what_is_known_from_before_is_taken_up() -> None:
    known = {"a": ReceiverOffset(0.0, 0.0), "b": ReceiverOffset(-3.0, 0.4)}
    receivers = Receivers(CONFIG, known)
    receivers.learn("b", 0.0, heard(-3.0, np.random.default_rng(0)))
    assert receivers.offsets == known
    receivers.learn("c", 100.0, heard(0.0, np.random.default_rng(1)))
    assert receivers.offsets["c"] == ReceiverOffset(0.0, CONFIG.prior_sigma_db)


def test_what_is_known_from_before_gives_way_to_what_is_heard() -> None:
    rng, receivers = (
        np.random.default_rng(3),
        Receivers(CONFIG, {"a": ReceiverOffset(0.0, 0.0), "b": ReceiverOffset(-3.0, 0.4)}),
    )
    for path_m in range(200):
        receivers.learn("a", path_m, heard(0.0, rng))
        receivers.learn("b", path_m + 0.2, heard(2.0, rng))
    assert abs(receivers.offsets["b"].offset_db - 2.0) < 0.8


def test_readings_are_corrected_by_what_is_known() -> None:
    receivers = Receivers(CONFIG, {"a": ReceiverOffset(0.0, 0.0), "b": ReceiverOffset(-3.0, 0.4)})
    uncorrected = readings({0: -50.0, 1: -63.5})
    assert receivers.corrected("b", uncorrected).rssi.tolist() == [-47.0, -60.5]
    assert receivers.corrected("b", uncorrected).bssids == uncorrected.bssids
    for receiver in ("a", "never heard"):
        np.testing.assert_array_equal(receivers.corrected(receiver, uncorrected).rssi, uncorrected.rssi)


@pytest.mark.parametrize("ahead_m", [-1.5, 1.5, 40.0])
def test_fingerprints_of_different_places_are_not_compared(ahead_m: float) -> None:
    rng, receivers = np.random.default_rng(0), Receivers(CONFIG, {})
    for path_m in range(0, 1000, 50):
        receivers.learn("a", path_m, heard(0.0, rng))
        receivers.learn("b", path_m + ahead_m, heard(-6.0, rng))
    assert receivers.offsets["b"].offset_db == 0.0
    assert receivers.offsets["b"].sigma_db >= CONFIG.prior_sigma_db


def test_a_robot_that_stands_still_measures_once() -> None:
    rng, receivers = np.random.default_rng(0), Receivers(CONFIG, {})
    for _ in range(100):
        receivers.learn("a", 7.0, heard(0.0, rng))
        receivers.learn("b", 7.0, heard(-6.0, rng))
    assert receivers.offsets["b"].sigma_db > 1.0


def test_too_few_common_access_points_say_nothing() -> None:
    receivers = Receivers(CONFIG, {})
    receivers.learn("a", 0.0, readings(dict.fromkeys(range(6), -50.0)))
    receivers.learn("b", 0.2, readings(dict.fromkeys(range(3, 9), -55.0)))
    assert receivers.offsets["b"] == ReceiverOffset(0.0, CONFIG.prior_sigma_db)


def test_the_stronger_half_of_what_both_heard_is_compared() -> None:
    a, b = (
        readings({0: -40.0, 1: -50.0, 2: -60.0, 3: -70.0, 8: -30.0}),
        readings({3: -90.0, 2: -80.0, 1: -53.0, 0: -44.0}),
    )
    assert stronger_differences(a, b).tolist() == [4.0, 3.0]
    assert stronger_differences(a, readings({9: -40.0})).tolist() == []


@pytest.mark.parametrize("seed", range(4))
def test_the_phones_of_a_simulated_drive_are_told_apart_to_a_decibel(seed: int) -> None:
    """Readings seconds old included, as phones report them."""
    run = start(World.OFFICE, seed, minutes=4.0)
    receivers, path_m = Receivers(CONFIG, {}), run.truth.path_m()
    for scan in wifi_scans(run):
        receivers.learn(scan.receiver, float(np.interp(scan.stamp_ns, run.truth.stamps_ns, path_m)), plain(scan))
    true_db = {phone.name: phone.offset_db for phone in run.receivers}
    first, second = receivers.offsets
    found = receivers.offsets[second]
    assert abs(found.offset_db - (true_db[second] - true_db[first])) < 1.0
    assert found.sigma_db < 1.0


def plain(scan: WifiScan) -> Readings:
    return Readings(scan.bssids, scan.rssi, scan.age_s)
