"""The watch over WiFi receivers: nothing sound is complained of, a fault is told when it begins and when it ends."""

import pickle
from collections.abc import Iterable

import numpy as np
import pytest

from wayfi.frontends.complaints import SILENT
from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.wifi.readings import Readings
from wayfi.frontends.wifi.wifi_config import WifiWatchConfig
from wayfi.frontends.wifi.wifi_watch import WifiWatch

CONFIG = WifiWatchConfig()
S = 1_000_000_000
STEP_M = 0.2  # of path between two scans
CLOCK_SCANS = CONFIG.window_scans


def readings(numbers: Iterable[int], rssi: Iterable[float]) -> Readings:
    bssids, levels = tuple(f"ap{n}" for n in numbers), np.array(list(rssi), np.float32)
    return Readings(bssids, levels, np.zeros(len(bssids), np.float32))


def sound(k: int, rng: np.random.Generator) -> Readings:
    """The k-th scan of a walk past access points, two new ones a scan; its levels fade by 4 dB."""
    numbers = np.flatnonzero(rng.random(30) < 0.8) + 2 * k
    return readings(numbers.tolist(), np.round(-60 + 4 * rng.standard_normal(len(numbers))))


def stuck(k: int) -> Readings:
    """A driver that gives every access point the same level."""
    return readings(range(2 * k, 2 * k + 20), [-50.0] * 20)


def randomised(k: int) -> Readings:
    return readings(range(1000 * k, 1000 * k + 20), range(-70, -50))


class Drive:
    """A receiver at one scan a second; what the watch says of it."""

    def __init__(self, receiver: str = "phone", watch: WifiWatch | None = None) -> None:
        self.watch, self.receiver = watch or WifiWatch(CONFIG), receiver
        self.rng, self.scans, self.path_m = np.random.default_rng(3), 0, 0.0
        self.refused: list[DropReason | None] = []
        self.warnings: list[Warned] = []

    def hear(self, heard: Readings, count: int | None = None, step_m: float = STEP_M) -> None:
        """A scan, `step_m` after the one before."""
        self.scans += 1
        self.path_m += step_m
        self.hear_from(heard, self.path_m, count)

    def hear_from(self, heard: Readings, taken_m: float, count: int | None = None) -> None:
        """Readings that were all taken at `taken_m`."""
        stamp_ns, number = self.scans * S, len(heard.bssids)
        events = list(self.watch.count(stamp_ns, self.receiver, count or number))
        if not events or not isinstance(events[-1], Dropped):
            events += self.watch.compare_rssi(stamp_ns, self.receiver, heard, np.full(number, taken_m))
        self._note(events)

    def hear_sound(self, count: int) -> None:
        for _ in range(count):
            self.hear(sound(self.scans, self.rng))

    def compare(self, ahead_s: float, count: int = 1) -> None:
        for _ in range(count):
            self._note(list(self.watch.compare_clocks(self.scans * S, self.receiver, round(ahead_s * S))))

    def pass_time(self, start_s: float, stop_s: float, every_s: float = 0.1) -> None:
        for second in np.arange(start_s, stop_s, every_s):
            self.warnings += [e for e in self.watch.pass_time(round(second * S)) if isinstance(e, Warned)]

    def complaints(self) -> list[tuple[str, bool]]:
        return [(w.complaint.removeprefix(f"{self.receiver}."), w.ends) for w in self.warnings]

    def _note(self, events: list[Event]) -> None:
        self.refused.append(next((e.reason for e in events if isinstance(e, Dropped)), None))
        self.warnings += [e for e in events if isinstance(e, Warned)]


def begins_and_ends(fault: str) -> list[tuple[str, bool]]:
    return [(fault, False), (fault, True)]


def test_a_sound_receiver_is_never_refused() -> None:
    drive = Drive()
    drive.hear_sound(300)
    assert drive.refused == [None] * 300
    assert drive.warnings == []


def test_a_driver_that_sends_every_channel_by_itself_is_never_refused() -> None:
    drive = Drive()
    for k in range(100):
        whole = sound(k, drive.rng)
        for i in range(0, len(whole.bssids), 2):
            drive.hear(Readings(whole.bssids[i : i + 2], whole.rssi[i : i + 2], whole.age_s[i : i + 2]), step_m=0.02)
    assert set(drive.refused) == {None}
    assert drive.warnings == []


def test_a_robot_that_stands_still_may_hear_the_same_for_ever() -> None:
    drive = Drive()
    for _ in range(100):
        drive.hear(stuck(0), step_m=0.0)
    assert drive.refused == [None] * 100
    assert drive.warnings == []


def test_what_a_phone_repeats_with_its_true_age_is_no_constant() -> None:
    drive = Drive()
    for _ in range(30):
        drive.hear_sound(1)
        taken_m = drive.path_m
        again = sound(drive.scans, drive.rng)
        for _ in range(10):
            drive.path_m += STEP_M
            drive.hear_from(again, taken_m)
    assert set(drive.refused) == {None}
    assert drive.warnings == []


def test_levels_that_stay_the_same_are_refused_as_soon_as_the_robot_moves() -> None:
    drive = Drive()
    for k in range(30):
        drive.hear(stuck(k))
    usable = drive.refused.count(None)
    assert usable * STEP_M <= 2 * CONFIG.level_change_m + STEP_M
    assert drive.refused == [None] * usable + [DropReason.CONSTANT_LEVELS] * (30 - usable)
    drive.hear_sound(20)
    assert drive.refused[-15:] == [None] * 15
    assert drive.complaints() == begins_and_ends(DropReason.CONSTANT_LEVELS)


def test_a_scan_that_freezes_is_refused_as_well() -> None:
    drive = Drive()
    drive.hear_sound(50)
    for _ in range(20):
        drive.hear(sound(50, np.random.default_rng(0)))
    usable = drive.refused[50:].count(None)
    assert usable * STEP_M <= 2 * CONFIG.level_change_m + STEP_M
    assert drive.refused[50 + usable :] == [DropReason.CONSTANT_LEVELS] * (20 - usable)
    assert drive.complaints() == [(DropReason.CONSTANT_LEVELS, False)]


def test_randomised_bssids_are_refused_after_a_few_scans() -> None:
    drive = Drive()
    for k in range(40):
        drive.hear(randomised(k))
    usable = drive.refused.count(None)
    assert 20 * usable < CONFIG.window_readings
    assert drive.refused == [None] * usable + [DropReason.RANDOMISED_BSSIDS] * (40 - usable)
    drive.hear_sound(5)
    assert drive.refused[-2:] == [None] * 2
    assert drive.complaints() == begins_and_ends(DropReason.RANDOMISED_BSSIDS)


def test_one_scan_of_too_many_readings_is_refused_and_told() -> None:
    drive = Drive()
    drive.hear_sound(10)
    drive.hear(sound(10, drive.rng), count=CONFIG.max_readings + 1)
    drive.hear_sound(20)
    assert drive.refused == [None] * 10 + [DropReason.TOO_MANY_READINGS] + [None] * 20
    assert drive.complaints() == begins_and_ends(DropReason.TOO_MANY_READINGS)
    assert str(CONFIG.max_readings + 1) in drive.warnings[0].text


def test_a_mall_full_of_access_points_is_no_fault() -> None:
    """A phone in a mall was seen to hear 437 of them in one scan, a few of them new each time."""
    watch, rng = WifiWatch(CONFIG), np.random.default_rng(0)
    for k in range(30):
        bssids = tuple(f"02:00:00:00:{n >> 8:02x}:{n & 255:02x}" for n in range(20 * k, 20 * k + 437))
        rssi = rng.uniform(-90, -40, 437).astype(np.float32)
        assert list(watch.count(k * S, "phone", 437)) == []
        heard = Readings(bssids, rssi, np.zeros(437, np.float32))
        assert list(watch.compare_rssi(k * S, "phone", heard, np.full(437, float(k)))) == []


@pytest.mark.parametrize(("ahead_s", "said"), [(5.0, "5.0 s ahead of"), (-5.0, "5.0 s behind")])
def test_a_clock_that_is_off_is_refused_at_once_and_told(ahead_s: float, said: str) -> None:
    drive = Drive()
    drive.hear_sound(1)
    drive.compare(ahead_s, 2 * CLOCK_SCANS)
    assert drive.refused[1:] == [DropReason.CLOCK_OFF] * 2 * CLOCK_SCANS
    assert said in drive.warnings[0].text
    drive.compare(0.0, CLOCK_SCANS)
    assert drive.refused[-1] is None
    assert drive.complaints() == begins_and_ends(DropReason.CLOCK_OFF)


def test_where_odometry_with_gaps_hides_the_offset_of_some_scans_these_are_refused_too() -> None:
    drive = Drive()
    drive.hear_sound(1)
    for _ in range(CLOCK_SCANS):
        drive.compare(5.0)
        drive.compare(1.5)
    drive.refused.clear()
    drive.compare(1.5)
    assert drive.refused == [DropReason.CLOCK_OFF]


def test_jitter_and_single_late_scans_are_no_clock_that_is_off() -> None:
    drive = Drive()
    drive.hear_sound(1)
    for k in range(200):
        drive.compare(-10.0 if k % 10 == 0 else CONFIG.clock_s * np.sin(k))
    assert drive.refused.count(DropReason.CLOCK_OFF) == 20
    assert drive.warnings == []


def test_a_receiver_that_stops_and_comes_back() -> None:
    drive = Drive()
    drive.pass_time(0.0, 1.0)
    drive.hear_sound(1)
    drive.pass_time(1.0, 1.0 + CONFIG.silent_s)
    assert drive.warnings == []
    drive.pass_time(1.0 + CONFIG.silent_s, 601.0)
    drive.hear_sound(1)
    drive.pass_time(601.0, 605.0)
    assert drive.complaints() == begins_and_ends(SILENT)


def test_gaps_of_the_odometry_are_not_held_against_a_receiver() -> None:
    drive = Drive()
    drive.pass_time(0.0, 1.0)
    drive.hear_sound(1)
    drive.pass_time(14.0, 40 * 14.0, every_s=14.0)
    assert drive.warnings == []


def test_a_phone_that_may_scan_twice_a_minute_is_not_silent() -> None:
    drive = Drive()
    for scan in range(20):
        drive.pass_time(30.0 * scan, 30.0 * (scan + 1))
        drive.hear_sound(1)
    assert drive.warnings == []


def test_receivers_are_judged_apart() -> None:
    watch = WifiWatch(CONFIG)
    good, bad = Drive("good", watch), Drive("bad", watch)
    for k in range(40):
        good.hear_sound(1)
        bad.hear(randomised(k))
    good.compare(0.0)
    bad.compare(5.0)
    assert set(good.refused) == {None}
    assert good.warnings == []
    assert bad.complaints() == [(DropReason.RANDOMISED_BSSIDS, False)]


def test_what_is_remembered_of_a_receiver_does_not_grow() -> None:
    drive = Drive()

    def size_after(scans: int) -> int:
        while drive.scans < scans:
            drive.hear(randomised(drive.scans))
            drive.compare(-5.0)
            drive.pass_time(drive.scans, drive.scans + 1.0)
        return len(pickle.dumps(drive.watch))

    early = size_after(500)
    assert size_after(5000) < 1.1 * early
