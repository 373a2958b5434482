"""The watch over the laser: nothing sound is complained of, a fault is told when it begins and when it ends."""

import math
import pickle

import numpy as np
import pytest

from wayfi.backend.pose2 import Floats
from wayfi.frontends.complaints import SILENT
from wayfi.frontends.events import Dropped, Event, Warned
from wayfi.frontends.lidar.laser_watch import (
    BLOCKED,
    FEW_RETURNS,
    LATE,
    LaserWatch,
)
from wayfi.frontends.lidar.lidar_config import LaserWatchConfig
from wayfi.frontends.measurements import LaserScan, PointCloud, Sweep

S = 1_000_000_000
BEAMS = 360
CONFIG = LaserWatchConfig()
LATE_NS = round(CONFIG.late_s * S)


def scan_of(ranges: Floats, range_max_m: float = 20.0) -> LaserScan:
    return LaserScan(0, "laser", ranges.astype(np.float32), -math.pi, math.radians(1.0), 0.06, range_max_m)


class Drive:
    """A laser at one scan a second; what the watch says of it."""

    def __init__(self) -> None:
        self.watch, self.rng, self.scans = LaserWatch(CONFIG), np.random.default_rng(3), 0
        self.events: list[Event] = []
        self.used: Sweep | None = None

    def see(self, scan: Sweep, late_ns: int = 0) -> None:
        self.scans += 1
        taking = self.watch.add_sweep(self.scans * S, scan, late_ns)
        while True:
            try:
                self.events.append(next(taking))
            except StopIteration as done:
                self.used = done.value
                return

    def walls(self) -> Floats:
        return self.rng.uniform(1.0, 12.0, BEAMS)

    def see_walls(self, count: int, late_ns: int = 0) -> None:
        for _ in range(count):
            self.see(scan_of(self.walls()), late_ns)

    def pass_time(self, start_s: float, stop_s: float, every_s: float = 0.1) -> None:
        for second in np.arange(start_s, stop_s, every_s):
            self.events += self.watch.check_silence(round(second * S))

    def complaints(self) -> list[tuple[str, bool]]:
        return [(e.complaint, e.ends) for e in self.events if isinstance(e, Warned) and e.complaint]

    def lost(self) -> int:
        return sum(isinstance(e, Dropped) for e in self.events)


def begins_and_ends(fault: str) -> list[tuple[str, bool]]:
    return [(f"laser.{fault}", False), (f"laser.{fault}", True)]


def test_a_sound_laser_is_used_as_it_is() -> None:
    drive = Drive()
    for _ in range(200):
        scan = scan_of(drive.walls())
        drive.see(scan)
        assert drive.used is scan
    assert drive.events == []


def test_a_sweep_cut_into_scans_is_no_fault() -> None:
    drive = Drive()
    for k in range(200):
        shown = np.arange(BEAMS) < (BEAMS if k % 30 > 3 else 2)
        drive.see(scan_of(np.where(shown, drive.walls(), np.inf)))
    assert drive.events == []


@pytest.mark.parametrize(("low_m", "high_m"), [(0.05, 0.1), (0.01, 0.05)])
def test_a_blocked_laser_is_not_used_and_told(low_m: float, high_m: float) -> None:
    drive = Drive()
    drive.see_walls(30)
    for _ in range(30):
        drive.see(scan_of(drive.rng.uniform(low_m, high_m, BEAMS)))
        assert drive.used is None
    drive.see_walls(CONFIG.window)
    assert drive.lost() == 30
    assert drive.complaints() == begins_and_ends(BLOCKED)


def test_a_robot_that_sees_a_fifth_of_itself_is_not_blocked() -> None:
    drive = Drive()
    for _ in range(50):
        drive.see(scan_of(np.where(np.arange(BEAMS) < BEAMS // 5, 0.1, drive.walls())))
    assert drive.events == []


@pytest.mark.parametrize("nothing", [np.inf, np.nan, 0.0, 20.0, 21.0, 19.99])
def test_few_returns_are_told_however_the_driver_says_so(nothing: float) -> None:
    drive = Drive()
    for _ in range(30):
        drive.see(scan_of(np.where(drive.rng.random(BEAMS) < 0.9, nothing, drive.walls())))
    drive.see_walls(CONFIG.window)
    assert drive.lost() == 0
    assert drive.complaints() == begins_and_ends(FEW_RETURNS)


def test_a_range_that_many_beams_share_at_the_top_is_no_return_and_told_once() -> None:
    drive = Drive()
    for k in range(100):
        share = 0.3 if k % 2 == 0 or k < CONFIG.no_return_scans else 0.01
        none = np.arange(BEAMS) < share * BEAMS
        drive.see(scan_of(np.where(none, 15.0, drive.walls())))
        assert isinstance(drive.used, LaserScan)
        assert np.array_equal(np.isinf(drive.used.ranges), none)
    told = [e for e in drive.events if isinstance(e, Warned)]
    assert ["15 m" in warned.text for warned in told] == [True]
    assert drive.complaints() == []


def test_a_wall_that_looked_like_no_return_is_seen_again_once_a_scan_sees_further() -> None:
    drive = Drive()
    wall = np.where(np.arange(BEAMS) < 40, 5.0, 3.0)
    drive.see(scan_of(wall))
    drive.see_walls(1)
    drive.see(scan_of(np.where(np.arange(BEAMS) < 2, 5.0, 3.0)))
    assert isinstance(drive.used, LaserScan)
    assert np.isfinite(drive.used.ranges).all()
    assert drive.events == []


def test_scans_that_come_late_are_told_and_used() -> None:
    drive = Drive()
    drive.see_walls(CONFIG.faulty, late_ns=LATE_NS + 1)
    drive.see_walls(CONFIG.window, late_ns=LATE_NS)
    assert drive.lost() == 0
    assert drive.complaints() == begins_and_ends(LATE)


def test_single_late_scans_are_no_fault() -> None:
    drive = Drive()
    for k in range(100):
        drive.see_walls(1, late_ns=5 * S if k % 3 == 0 else 0)
    assert drive.events == []


def test_a_laser_that_stops_and_comes_back() -> None:
    drive = Drive()
    drive.pass_time(0.0, 100.0)
    drive.see_walls(1)
    drive.pass_time(100.0, 100.0 + CONFIG.silent_s)
    assert drive.events == []
    drive.pass_time(100.0 + CONFIG.silent_s, 200.0)
    drive.see_walls(1)
    drive.pass_time(200.0, 201.0)
    assert drive.complaints() == begins_and_ends(SILENT)


def test_scans_14_s_apart_and_gaps_of_the_odometry_are_no_silence() -> None:
    drive = Drive()
    for k in range(20):
        drive.see_walls(1)
        drive.pass_time(14.0 * k, 14.0 * (k + 1))
    drive.pass_time(300.0, 300.0 + 15 * 14.0, every_s=14.0)
    assert drive.events == []


def test_of_a_cloud_the_time_is_watched() -> None:
    drive, cloud = Drive(), PointCloud(0, "lidar", np.zeros((0, 3), np.float32))
    for _ in range(CONFIG.window):
        drive.see(cloud, late_ns=2 * S)
        assert drive.used is cloud
    assert drive.complaints() == [(f"laser.{LATE}", False)]


def test_what_is_remembered_does_not_grow() -> None:
    drive = Drive()
    drive.see_walls(100)
    early = len(pickle.dumps(drive.watch))
    drive.see_walls(2000)
    assert len(pickle.dumps(drive.watch)) <= 1.1 * early
