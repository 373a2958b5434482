"""The campus: kilometres of bare corridor, a laser that sees little of it, WiFi that tells corridors apart."""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from wayfi.frontends.measurements import LaserScan
from wayfi.recordings.simulation.robots.models import Robot
from wayfi.recordings.simulation.run import EPOCH_NS, Run, measurements, start, wifi_scans
from wayfi.recordings.simulation.worlds import campus
from wayfi.recordings.simulation.worlds.blueprints import World

Floats = NDArray[np.float64]


@cache
def ideal_run() -> Run:
    return start(World.CAMPUS, seed=0, robot=Robot.IDEAL)


def test_two_kilometres() -> None:
    assert 2000.0 < ideal_run().truth.path_m()[-1] < 2300.0


def test_the_first_loop_is_long_and_half_of_the_way_is_driven_again() -> None:
    way = ideal_run().drive.at(np.arange(0.0, 2150.0, 1.0))[:, :2]
    apart = np.hypot(*(way[:, None] - way[None]).transpose(2, 0, 1))
    seen_before = np.tril(apart < 1.0, -30).any(axis=1)
    assert 700 < seen_before.argmax() < 760
    assert 0.4 < seen_before.mean() < 0.7


def test_the_laser_has_180_beams_over_180_degrees_of_8_m_twice_a_second() -> None:
    received = [m for m in measurements(start(World.CAMPUS, 0, minutes=0.5)) if isinstance(m, LaserScan)]
    assert {len(scan.ranges) for scan in received} == {180}
    assert set(np.diff([scan.stamp_ns for scan in received]).tolist()) == {500_000_000}
    assert math.isclose(received[0].angle_increment, math.radians(1.0))
    assert math.isclose(received[0].angle_min, -received[0].angle_min - 179 * received[0].angle_increment)
    seen = np.concatenate([scan.ranges for scan in received])
    assert seen[np.isfinite(seen)].max() <= 8.0


def test_corridors_are_two_to_three_metres_wide() -> None:
    widths = 2 * np.array([*campus.COLUMN_HALF_WIDTHS_M, *campus.ROW_HALF_WIDTHS_M])
    assert widths.min() >= 2.0
    assert widths.max() <= 3.0


def test_along_much_of_the_way_no_door_and_no_corner_is_in_sight() -> None:
    corners = ideal_run().surfaces.ends[:, :2]
    bare = []
    for pose in ideal_run().drive.at(np.arange(0.0, 2150.0, 5.0)):
        to = corners - pose[:2]
        ahead = to @ [math.cos(pose[2]), math.sin(pose[2])] > 0.0
        bare.append(not (ahead & (np.hypot(*to.T) < campus.LASER.range_max_m)).any())
    assert np.mean(bare) > 0.4


def test_wifi_is_heard_everywhere_and_tells_corridors_apart() -> None:
    heard = list(wifi_scans(ideal_run()))[::10]
    at = ideal_run().drive.poses(np.array([(scan.stamp_ns - EPOCH_NS) / 1e9 for scan in heard]))[:, :2]
    apart = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    names = [set(scan.bssids) for scan in heard]
    alike = np.array([[len(a & b) / max(len(a | b), 1) for b in names] for a in names])
    assert 5 < np.median([len(scan) for scan in names]) < 20
    assert np.mean([len(scan) == 0 for scan in names]) < 0.01
    assert np.median(alike[(apart > 0) & (apart < 3.0)]) > 0.5
    assert np.quantile(alike[apart > 50.0], 0.95) < 0.15
