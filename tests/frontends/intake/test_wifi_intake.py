"""WiFi scans before they become fingerprints: their order, their wait for the odometry, their readings' places."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import pytest

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.intake.wifi_intake import WifiIntake
from wayfi.frontends.measurements import WifiScan
from wayfi.frontends.odometry.driven_path import DrivenPath
from wayfi.frontends.odometry.odometry_config import ClockConfig, OdometryConfig
from wayfi.frontends.odometry.timebase import TimeBase
from wayfi.frontends.wifi.readings import PlacedWifiScan
from wayfi.frontends.wifi.wifi_config import WifiConfig

CONFIG, CLOCK = WifiConfig(), ClockConfig()
S = 1_000_000_000
SPEED_M_S = 0.5


def scan(stamp_s: float, ages_s: Iterable[float], receiver: str = "phone") -> WifiScan:
    """Levels that tell a scan's second, and BSSIDs that are always the same."""
    age_s = np.array(list(ages_s), np.float32)
    bssids = tuple(f"02:00:00:00:00:{n:02x}" for n in range(len(age_s)))
    rssi = np.full(len(age_s), -40 - stamp_s % 50, np.float32)
    return WifiScan(round(stamp_s * S), receiver, bssids, rssi, age_s, (), ())


@dataclass
class Drive:
    """A robot that drives straight on, and what its intake gives and says."""

    path: DrivenPath = field(default_factory=lambda: DrivenPath(OdometryConfig()))
    time: TimeBase = field(default_factory=lambda: TimeBase(CLOCK))
    placed: list[PlacedWifiScan] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.intake = WifiIntake(CONFIG, CLOCK, self.time)

    def odometry(self, second: float) -> None:
        self.time.accept(round(second * S))
        self._sort(self.intake.compare(round(second * S)))
        self.path.advance(round(second * S), Pose2(SPEED_M_S * second, 0.0, 0.0))
        self._sort(self.intake.ready(self.path))

    def hear(self, heard: WifiScan) -> None:
        self._sort(self.intake.add(heard, self.path.latest))
        self._sort(self.intake.ready(self.path))

    def finish(self) -> None:
        self._sort(self.intake.finish())

    def dropped(self) -> list[DropReason]:
        return [event.reason for event in self.events if isinstance(event, Dropped)]

    def seconds(self, receiver: str = "phone") -> list[float]:
        """When the scans that were placed had ended."""
        return [p.point.stamp_ns / S for p in self.placed if p.receiver == receiver]

    def _sort(self, what: Iterable[PlacedWifiScan | Event]) -> None:
        for one in what:
            if isinstance(one, PlacedWifiScan):
                self.placed.append(one)
            else:
                self.events.append(one)


def test_a_scan_whose_ages_are_unknown_stays_as_it_is() -> None:
    drive = Drive()
    for tenth in range(300):
        drive.odometry(tenth / 10)
        if tenth % 10 == 5:
            drive.hear(scan(tenth / 10, [0.0] * 5))
    assert drive.seconds() == [s + 0.5 for s in range(30)]
    for placed in drive.placed:
        assert placed.point.T_path_base.x == pytest.approx(SPEED_M_S * placed.point.stamp_ns / S)
        assert set(placed.readings.rssi.tolist()) == {-40.0 - placed.point.stamp_ns / S}


def test_a_scan_whose_readings_are_all_as_old_is_placed_where_they_were_taken() -> None:
    drive = Drive()
    for tenth in range(100):
        drive.odometry(tenth / 10)
        if tenth % 10 == 9:
            drive.hear(scan(tenth / 10, [0.8] * 5))
    assert drive.seconds() == pytest.approx([second + 0.1 for second in range(10)], abs=1e-6)
    assert [p.point.path_m for p in drive.placed] == pytest.approx([SPEED_M_S * (s + 0.1) for s in range(10)], abs=1e-6)


def test_each_reading_counts_where_the_robot_was_then() -> None:
    drive = Drive()
    for tenth in range(1, 401):
        drive.odometry(tenth / 10)
        if tenth % 100 == 0:
            drive.hear(scan(tenth / 10, [0.0, 0.1, 10.0, 10.1]))
    drive.finish()
    assert drive.seconds() == [10.0, 20.0, 30.0, 40.0]
    levels = [dict(zip(placed.readings.bssids, placed.readings.rssi.tolist(), strict=True)) for placed in drive.placed]
    first, second, third, fourth = scan(0.0, [0.0] * 4).bssids
    for at, level in enumerate(levels[:-1]):
        assert level[first] == level[second] == -40.0 - 10.0 * (at + 1)
        assert level[third] == level[fourth] == -40.0 - 10.0 * (at + 2)
    assert set(levels[-1]) == {first, second}


def test_readings_older_than_the_path_that_is_kept_have_no_place() -> None:
    drive = Drive()
    for tenth in range(600):
        drive.odometry(tenth / 10)
    drive.hear(scan(59.9, [0.0, 45.0, 50.0]))
    drive.finish()
    (placed,) = drive.placed
    assert len(placed.readings.bssids) == 1
    assert drive.dropped() == [DropReason.TOO_LATE] * 2


def test_a_scan_waits_for_the_odometry_and_no_other_receiver_waits_for_it() -> None:
    drive = Drive()
    drive.odometry(10.0)
    drive.hear(scan(11.0, [0.0] * 3, "early"))
    drive.hear(scan(10.0, [0.0] * 3, "right"))
    assert [placed.receiver for placed in drive.placed] == ["right"]
    drive.odometry(10.9)
    assert len(drive.placed) == 1
    drive.odometry(11.1)
    assert [placed.receiver for placed in drive.placed] == ["right", "early"]
    assert drive.events == []


def test_scans_before_the_first_pose_wait_for_five_seconds() -> None:
    drive = Drive()
    for second in range(10):
        drive.hear(scan(float(second), [0.0] * 3))
    drive.odometry(9.0)
    early = round(CONFIG.first_pose_s)
    assert drive.dropped() == [DropReason.NO_POSE] * (9 - early)
    assert len(drive.placed) == early + 1
    assert {placed.point.stamp_ns for placed in drive.placed} == {9 * S}


def test_a_gap_of_the_odometry_costs_no_scan() -> None:
    drive = Drive()
    drive.odometry(0.0)
    wait = round(CONFIG.odometry_s)
    for second in range(1, wait + 3):
        drive.hear(scan(float(second), [0.0] * 3))
    drive.odometry(wait + 3.0)
    assert drive.dropped() == [DropReason.NO_POSE]
    assert drive.seconds() == list(range(2, wait + 3))


def test_at_the_end_what_waits_for_the_odometry_is_dropped() -> None:
    drive = Drive()
    drive.hear(scan(1.0, [0.0] * 3))
    drive.finish()
    (event,) = drive.events
    assert isinstance(event, Dropped)
    assert (event.stamp_ns, event.reason) == (S, DropReason.NO_POSE)


def test_repeated_scans_and_single_stamps_that_jump_back_are_dropped() -> None:
    drive = Drive()
    drive.odometry(0.0)
    for stamp_s in (1.0, 1.0, 2.0, 1.5, 3.0):
        drive.hear(scan(stamp_s, [0.0] * 3))
    drive.odometry(4.0)
    assert drive.dropped() == [DropReason.DUPLICATE, DropReason.STAMP_BACK]
    assert drive.seconds() == [1.0, 2.0, 3.0]


def test_a_phone_whose_clock_is_set_back_is_followed_and_moves_no_other_stamp() -> None:
    drive = Drive()
    for second in range(100):
        drive.odometry(float(second))
        shift_s = -5.3 if second >= 50 else 0.0
        drive.hear(scan(second + shift_s, [0.0] * 3))
        drive.hear(scan(float(second), [0.0] * 3, "other"))
    assert drive.dropped() == [DropReason.STAMP_BACK] * (CLOCK.lasting_messages - 1)
    assert drive.seconds() == [s for s in range(100) if not 50 <= s < 49 + CLOCK.lasting_messages]
    assert drive.seconds("other") == list(range(100))
    (warned,) = [event for event in drive.events if isinstance(event, Warned)]
    assert warned.text.startswith("WiFi receiver 'phone': its clock was set back by 5.300 s")
