"""WiFi scans of the receivers, against what was planned."""

import math
from functools import cache

import numpy as np
from drives import whole_run

from wayfi.backend.pose2 import Floats
from wayfi.frontends.measurements import WifiScan
from wayfi.recordings.simulation import radio
from wayfi.recordings.simulation.run import EPOCH_NS, Run, wifi_scans
from wayfi.recordings.simulation.worlds.blueprints import World


def car_park() -> Run:
    return whole_run(World.CARPARK, seed=0)


@cache
def heard() -> tuple[WifiScan, ...]:
    return tuple(wifi_scans(car_park()))


def test_over_a_thousand_bssids_and_about_45_readings_a_scan() -> None:
    assert len({bssid for scan in heard() for bssid in scan.bssids}) > 1000
    assert 38 < np.mean([len(scan.bssids) for scan in heard()]) < 52


def test_no_bssid_twice_in_a_scan_and_half_of_all_are_local() -> None:
    assert all(len(set(scan.bssids)) == len(scan.bssids) for scan in heard())
    pool = car_park().environment.bssids
    assert len(set(pool)) == len(pool)
    local = [bool(int(bssid[:2], 16) & 0x02) for bssid in pool]
    assert 0.45 < np.mean(local) < 0.55
    assert not any(int(bssid[:2], 16) & 0x01 for bssid in pool)


def test_rssi_is_in_whole_dbm_above_the_detection_limit() -> None:
    rssi = np.concatenate([scan.rssi for scan in heard()])
    np.testing.assert_array_equal(rssi, np.round(rssi))
    assert rssi.min() == radio.DETECTION_LIMIT_DBM
    assert rssi.max() < -10


def test_ages_are_seconds_with_a_tail_and_never_before_the_start() -> None:
    ages = np.concatenate([scan.age_s for scan in heard()])
    assert 1.0 < np.median(ages) < 3.0
    assert 10.0 < np.quantile(ages, 0.99) < ages.max() <= 20.0
    for scan in heard()[:20]:
        assert scan.age_s.max() <= (scan.stamp_ns - EPOCH_NS) / 1e9 + 1e-6


def test_a_reading_is_of_the_place_where_the_robot_was_when_it_was_taken() -> None:
    asked: list[Floats] = []

    def poses(time_s: Floats) -> Floats:
        asked.append(time_s)
        return car_park().drive.poses(time_s)

    scan = radio.wifi_scan(
        car_park().environment, car_park().receivers[0], EPOCH_NS, 100.0, poses, np.random.default_rng(0)
    )
    numbers = [car_park().environment.bssids.index(bssid) for bssid in scan.bssids]
    np.testing.assert_allclose(asked[0][numbers], 100.0 - scan.age_s, atol=1e-5)


def test_the_phones_read_some_db_apart() -> None:
    level = {name: mean_rssi(name) for name in radio.PHONES}
    common = level["phone_a"].keys() & level["phone_b"].keys()
    apart = np.mean([level["phone_b"][bssid] - level["phone_a"][bssid] for bssid in common])
    first, second = car_park().receivers
    assert np.sign(apart) == np.sign(second.offset_db - first.offset_db)
    assert abs(second.offset_db - first.offset_db) >= 2.0


def mean_rssi(phone: str) -> dict[str, float]:
    """Of each BSSID in the drive's first five minutes."""
    readings: dict[str, list[float]] = {}
    for scan in heard()[:300]:
        if scan.receiver == phone:
            for bssid, rssi in zip(scan.bssids, scan.rssi.tolist(), strict=True):
                readings.setdefault(bssid, []).append(rssi)
    return {bssid: float(np.mean(values)) for bssid, values in readings.items()}


def test_near_scans_are_more_alike_than_far_ones() -> None:
    place = car_park().drive.poses(np.array([(scan.stamp_ns - EPOCH_NS) / 1e9 for scan in heard()]))[:, :2]
    shared: dict[bool, list[float]] = {True: [], False: []}
    for i in range(0, len(heard()), 40):
        for j in range(i + 100, len(heard()), 7):
            apart = math.dist(place[i], place[j])
            if apart < 3.0 or 20.0 < apart < 30.0:
                a, b = set(heard()[i].bssids), set(heard()[j].bssids)
                shared[apart < 3.0].append(len(a & b) / len(a | b))
    assert np.mean(shared[True]) > 1.5 * np.mean(shared[False])


def test_shadowing_is_of_the_planned_size_and_smooth_in_space() -> None:
    ether, count = car_park().environment, len(car_park().environment.bssids)
    rng = np.random.default_rng(0)
    here = rng.uniform(0.0, 100.0, (count, 2))
    loud = np.zeros(count)
    shadow, beside, far = (radio.shadowing(ether, here + np.array([d, 0.0]), loud) for d in (0.0, 0.5, 30.0))
    assert 4.0 < shadow.std() < 6.0
    assert np.corrcoef(shadow, beside)[0, 1] > 0.95
    assert abs(np.corrcoef(shadow, far)[0, 1]) < 0.2
