"""The simulated laser and phones, against geometry and against what was planned."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from wayfi.backend.pose2 import Pose2, compose_all
from wayfi.frontends.measurements import LaserScan, StaticTransforms
from wayfi.recordings.simulation import laser, radio, surfaces
from wayfi.recordings.simulation.run import EPOCH_NS, measurements, start, wifi_scans
from wayfi.recordings.simulation.worlds import World

Floats = NDArray[np.float64]

CAR_PARK = start(World.CARPARK, seed=0)
HEARD = tuple(wifi_scans(CAR_PARK))


def distances_m(point: Floats, ends: Floats) -> Floats:
    """(n,) from `point` (2,) to each of the faces (n, 4)."""
    start_xy, along = ends[:, :2], ends[:, 2:] - ends[:, :2]
    fraction = np.clip(((point - start_xy) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.asarray(np.hypot(*(start_xy + fraction[:, None] * along - point).T))


# The laser


def in_a_box(pose: Pose2) -> Floats:
    room = surfaces.still(surfaces.box(-3.0, -2.0, 5.0, 4.0))
    return laser.ranges(room, pose.array()[None], np.zeros(1))[0]


def bearings(pose: Pose2) -> Floats:
    return np.asarray(pose.theta + laser.UST_20LX.bearings)


@pytest.mark.parametrize("pose", [Pose2(), Pose2(1.0, -1.0, 2.5), Pose2(4.0, 3.5, -3.1)], ids=str)
def test_ranges_in_a_box_are_those_of_geometry(pose: Pose2) -> None:
    with np.errstate(divide="ignore"):
        to_x = np.where(np.cos(bearings(pose)) > 0, 5.0 - pose.x, -3.0 - pose.x) / np.cos(bearings(pose))
        to_y = np.where(np.sin(bearings(pose)) >= 0, 4.0 - pose.y, -2.0 - pose.y) / np.sin(bearings(pose))
    np.testing.assert_allclose(in_a_box(pose), np.minimum(to_x, to_y), rtol=1e-9)


def straight_ahead_m(shape: surfaces.Surfaces, time_s: float = 0.0) -> float:
    """The range from the origin along x."""
    return float(laser.ranges(shape, np.zeros((1, 3)), np.array([time_s]))[0, laser.UST_20LX.beams // 2])


def test_nothing_within_range_is_no_return() -> None:
    assert straight_ahead_m(surfaces.still(np.array([[20.1, -1.0, 20.1, 1.0]]))) == math.inf
    assert straight_ahead_m(surfaces.still(np.array([[19.9, -1.0, 19.9, 1.0]]))) == pytest.approx(19.9)


def test_what_moves_is_where_it_is_now() -> None:
    car = surfaces.moving(np.array([[5.0, -1.0, 5.0, 1.0]]), since_s=10.0, until_s=14.0, velocity_xy=(1.0, 0.0))
    assert straight_ahead_m(car, 9.9) == math.inf
    assert straight_ahead_m(car, 13.0) == pytest.approx(8.0)
    assert straight_ahead_m(car, 14.0) == math.inf
    np.testing.assert_allclose(car.at(13.0), [[8.0, -1.0, 8.0, 1.0]])


def test_noise_is_one_to_three_centimetres() -> None:
    run = start(World.OFFICE, 0, minutes=0.5, rough=False)
    times_s = np.arange(0.0, 30.0, 1.0)
    poses = compose_all(run.drive.poses(times_s), np.array([0.2, 0.0, 0.0]))
    exact = laser.ranges(run.surfaces, poses, times_s)
    noisy = laser.scans(run.surfaces, poses, times_s, np.random.default_rng(1))
    error = noisy[exact < 19.5] - exact[exact < 19.5]
    assert abs(error.mean()) < 0.001
    assert 0.01 < error.std() < 0.03


def test_scans_are_seen_from_the_laser_in_front_of_the_base() -> None:
    run = start(World.OFFICE, 0, minutes=0.1, rough=False)
    received = list(measurements(run))
    transforms = next(m for m in received if isinstance(m, StaticTransforms)).transforms
    scan = next(m for m in received if isinstance(m, LaserScan))
    assert transforms[0].child_frame_id == scan.frame_id == "laser"
    T_base_laser = Pose2(*transforms[0].translation_xyz[:2], 0.0)
    T_map_base = Pose2.of(run.drive.poses(np.array([(scan.stamp_ns - EPOCH_NS) / 1e9]))[0])
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    hit = np.flatnonzero(np.isfinite(scan.ranges))[::20]
    hits = scan.ranges[hit, None] * np.column_stack([np.cos(angles[hit]), np.sin(angles[hit])])
    seen = (T_map_base @ T_base_laser).transform(hits)
    assert max(distances_m(point, run.surfaces.at(0.0)).min() for point in seen) < 0.12


# The phones


def test_over_a_thousand_bssids_and_about_45_readings_a_scan() -> None:
    assert len({bssid for scan in HEARD for bssid in scan.bssids}) > 1000
    assert 38 < np.mean([len(scan.bssids) for scan in HEARD]) < 52


def test_no_bssid_twice_in_a_scan_and_half_of_all_are_local() -> None:
    assert all(len(set(scan.bssids)) == len(scan.bssids) for scan in HEARD)
    pool = CAR_PARK.ether.bssids
    assert len(set(pool)) == len(pool)
    local = [bool(int(bssid[:2], 16) & 0x02) for bssid in pool]
    assert 0.45 < np.mean(local) < 0.55
    assert not any(int(bssid[:2], 16) & 0x01 for bssid in pool)


def test_rssi_is_in_whole_dbm_above_the_detection_limit() -> None:
    rssi = np.concatenate([scan.rssi for scan in HEARD])
    np.testing.assert_array_equal(rssi, np.round(rssi))
    assert rssi.min() == radio.DETECTION_LIMIT_DBM
    assert rssi.max() < -10


def test_ages_are_seconds_with_a_tail_and_never_before_the_start() -> None:
    ages = np.concatenate([scan.age_s for scan in HEARD])
    assert 1.0 < np.median(ages) < 3.0
    assert 10.0 < np.quantile(ages, 0.99) < ages.max() <= 20.0
    for scan in HEARD[:20]:
        assert scan.age_s.max() <= (scan.stamp_ns - EPOCH_NS) / 1e9 + 1e-6


def test_a_reading_is_of_the_place_where_the_robot_was_when_it_was_taken() -> None:
    asked: list[Floats] = []

    def poses(time_s: Floats) -> Floats:
        asked.append(time_s)
        return CAR_PARK.drive.poses(time_s)

    scan = radio.hear(CAR_PARK.ether, CAR_PARK.phones[0], EPOCH_NS, 100.0, poses, np.random.default_rng(0))
    heard = [CAR_PARK.ether.bssids.index(bssid) for bssid in scan.bssids]
    np.testing.assert_allclose(asked[0][heard], 100.0 - scan.age_s, atol=1e-5)


def test_the_phones_read_some_db_apart() -> None:
    level = {name: mean_rssi(name) for name in radio.PHONES}
    common = level["phone_a"].keys() & level["phone_b"].keys()
    apart = np.mean([level["phone_b"][bssid] - level["phone_a"][bssid] for bssid in common])
    first, second = CAR_PARK.phones
    assert np.sign(apart) == np.sign(second.offset_db - first.offset_db)
    assert abs(second.offset_db - first.offset_db) >= 2.0


def mean_rssi(phone: str) -> dict[str, float]:
    """Of each BSSID in the drive's first five minutes."""
    readings: dict[str, list[float]] = {}
    for scan in HEARD[:300]:
        if scan.receiver == phone:
            for bssid, rssi in zip(scan.bssids, scan.rssi.tolist(), strict=True):
                readings.setdefault(bssid, []).append(rssi)
    return {bssid: float(np.mean(values)) for bssid, values in readings.items()}


def test_near_scans_are_more_alike_than_far_ones() -> None:
    place = CAR_PARK.drive.poses(np.array([(scan.stamp_ns - EPOCH_NS) / 1e9 for scan in HEARD]))[:, :2]
    shared: dict[bool, list[float]] = {True: [], False: []}
    for i in range(0, len(HEARD), 40):
        for j in range(i + 100, len(HEARD), 7):
            apart = math.dist(place[i], place[j])
            if apart < 3.0 or 20.0 < apart < 30.0:
                a, b = set(HEARD[i].bssids), set(HEARD[j].bssids)
                shared[apart < 3.0].append(len(a & b) / len(a | b))
    assert np.mean(shared[True]) > 1.5 * np.mean(shared[False])


def test_shadowing_is_of_the_planned_size_and_smooth_in_space() -> None:
    ether, count = CAR_PARK.ether, len(CAR_PARK.ether.bssids)
    rng = np.random.default_rng(0)
    here = rng.uniform(0.0, 100.0, (count, 2))
    loud = np.zeros(count)
    shadow, beside, far = (radio.shadowing(ether, here + np.array([d, 0.0]), loud) for d in (0.0, 0.5, 30.0))
    assert 4.0 < shadow.std() < 6.0
    assert np.corrcoef(shadow, beside)[0, 1] > 0.95
    assert abs(np.corrcoef(shadow, far)[0, 1]) < 0.2
