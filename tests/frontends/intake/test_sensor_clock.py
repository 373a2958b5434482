"""Every sensor's stamps come onto the time base of the odometry, whichever clock is set, and however it is."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.frontends.events import DropReason
from wayfi.frontends.intake.sensor_clock import SensorClock
from wayfi.frontends.odometry.odometry_config import ClockConfig
from wayfi.frontends.odometry.timebase import LAST_LEAP_NS, Stamped, TimeBase

CONFIG = ClockConfig()
S, MS = 1_000_000_000, 1_000_000
START = 1_700_000_000 * S
ODOMETRY_NS, SCAN_NS = 50 * MS, 200 * MS
Clock = Callable[[int], int]
"""What a clock shows at a true time, ns after the start."""


def right(now_ns: int) -> int:
    return START + now_ns


def set_by(seconds: float, at_s: float = 20.0, clock: Clock = right) -> Clock:
    return lambda now_ns: clock(now_ns) + (round(seconds * S) if now_ns >= at_s * S else 0)


@dataclass
class Drive:
    """Odometry and a laser whose scans come in `latency_ns` after their stamp; both accept what comes."""

    odometry: Clock = right
    laser: Clock = right
    seconds: int = 60
    scan_ns: int = SCAN_NS
    latency_ns: int = 30 * MS
    odometry_ns: int = ODOMETRY_NS
    pauses: tuple[tuple[str, float, float], ...] = ()  # a sensor, and from when to when it is silent, s
    base: TimeBase = field(default_factory=lambda: TimeBase(CONFIG))
    scans: list[tuple[int, Stamped]] = field(default_factory=list)  # each with the true time of it

    def run(self) -> "Drive":
        clock = SensorClock(CONFIG, self.base)
        for _, sensor, true_ns in sorted([*self._sent("odometry"), *self._sent("laser")]):
            if sensor == "odometry":
                self.base.accept(self.odometry(true_ns))
            else:
                self.scans.append((true_ns, clock.accept(self.laser(true_ns), lambda ns=true_ns: str(ns).encode())))
        return self

    def _sent(self, sensor: str) -> Iterator[tuple[int, str, int]]:
        step_ns, latency_ns = (self.odometry_ns, MS) if sensor == "odometry" else (self.scan_ns, self.latency_ns)
        for true_ns in range(0, self.seconds * S, step_ns):
            if not any(name == sensor and a * S <= true_ns < b * S for name, a, b in self.pauses):
                yield true_ns + latency_ns, sensor, true_ns

    def errors_ns(self, base: Clock = right) -> list[int]:
        """By how much the stamps of the scans that are used differ from where the odometry was then."""
        return [abs(s.stamp_ns - base(true_ns)) for true_ns, s in self.scans if not s.dropped]

    def reasons(self) -> list[DropReason]:
        return [s.dropped for _, s in self.scans if s.dropped]

    def told(self) -> list[str]:
        return [s.told for _, s in self.scans if s.told]


DROPPED = CONFIG.lasting_messages - 1


def test_sound_clocks_are_left_alone() -> None:
    drive = Drive().run()
    assert (max(drive.errors_ns()), drive.reasons(), drive.told()) == (0, [], [])


@pytest.mark.parametrize("scan_ns", [25 * MS, 100 * MS, 200 * MS, 1000 * MS])
@pytest.mark.parametrize("latency_ns", [0, 30 * MS, 300 * MS])
@pytest.mark.parametrize("step_s", [-3600.0, -5.0, -1.5, 1.8, 5.0, 3600.0])
def test_a_laser_whose_clock_is_set_is_followed(step_s: float, latency_ns: int, scan_ns: int) -> None:
    drive = Drive(laser=set_by(step_s), scan_ns=scan_ns, latency_ns=latency_ns).run()
    late = [error for error in drive.errors_ns() if error > ODOMETRY_NS]
    assert len(late) <= (step_s > 0) * ODOMETRY_NS // scan_ns  # before the next odometry a leap ahead may be a pause
    assert len(drive.reasons()) + len(late) <= DROPPED * max(1, ODOMETRY_NS // scan_ns) + 2
    (told,) = drive.told()
    where = "back" if step_s < 0 else "forward"
    assert told.startswith(f"its clock was set {where} by {abs(step_s):.0f}"[:-1])
    assert drive.base.offset_ns == 0


@pytest.mark.parametrize("step_s", [-5.0, 9.0])
def test_odometry_that_comes_seldom_tells_a_step_as_well(step_s: float) -> None:
    drive = Drive(laser=set_by(step_s), scan_ns=1000 * MS, odometry_ns=3300 * MS, seconds=120).run()
    assert max(drive.errors_ns()[25:]) == 0
    assert len(drive.told()) == 1
    assert len(drive.reasons()) <= CONFIG.lasting_messages * 3300 // 1000 + 1


@pytest.mark.parametrize("odometry_ns", [1500 * MS, 2980 * MS, 3020 * MS, 4000 * MS])
def test_lags_that_wander_are_no_steps(odometry_ns: int) -> None:
    drive = Drive(scan_ns=3000 * MS, odometry_ns=odometry_ns, seconds=1000).run()
    assert (max(drive.errors_ns()), drive.reasons(), drive.told()) == (0, [], [])


@pytest.mark.parametrize("odometry_after_ns", [0, 100 * MS])
def test_scans_that_come_before_the_odometry_of_their_stamp_are_no_steps(odometry_after_ns: int) -> None:
    """As in a log of key scans, each written before the pose that it was taken at, where the robot drives or waits."""
    base, true_ns, dropped = TimeBase(CONFIG), START, []
    clock = SensorClock(CONFIG, base)
    intervals_s = [*[1.4] * 20, *[7.0] * 20, *[2.0, 11.0, 3.3] * 10, *[14.0] * 10, *[1.2] * 20]
    for interval_s in intervals_s:
        true_ns += round(interval_s * S)
        scan = clock.accept(true_ns, lambda ns=true_ns: str(ns).encode())
        assert (scan.shift_ns, scan.told) == (0, "")
        dropped.append(scan.dropped is not None)
        base.accept(true_ns + odometry_after_ns)
    assert sum(dropped) <= 4  # one for each time that it takes longer than it did


def test_a_first_scan_that_ends_a_pause_of_the_odometry_is_no_step() -> None:
    """It comes before the odometry of its stamp, and those after it come so soon that they are hardly ahead."""
    base = TimeBase(CONFIG)
    clock = SensorClock(CONFIG, base)
    base.accept(START)
    for k in range(100):
        true_ns = START + 6 * S + k * ODOMETRY_NS
        if k % 40 == 0:
            assert clock.accept(true_ns, lambda ns=true_ns: str(ns).encode()) == Stamped(true_ns)
        base.accept(true_ns)


def test_odometry_that_dies_after_a_step_costs_ten_seconds() -> None:
    drive = Drive(laser=set_by(5.0), pauses=(("odometry", 20.3, 60.0),)).run()
    assert len(drive.reasons()) <= 10 * S // SCAN_NS + CONFIG.lasting_messages


@pytest.mark.parametrize("step_s", [-3600.0, -5.0, -1.5])
def test_odometry_that_is_set_back_moves_no_scan(step_s: float) -> None:
    drive = Drive(odometry=set_by(step_s)).run()
    assert (max(drive.errors_ns()), drive.reasons(), drive.told()) == (0, [], [])
    assert drive.base.offset_ns == -round(step_s * S)


@pytest.mark.parametrize("step_s", [1.8, 5.0, 40.0])
def test_scans_follow_odometry_that_is_set_forward(step_s: float) -> None:
    odometry = set_by(step_s)
    drive = Drive(odometry=odometry).run()
    assert max(drive.errors_ns(odometry)) <= ODOMETRY_NS
    assert drive.reasons() == [DropReason.CLOCK_OFF] * DROPPED
    (told,) = drive.told()
    assert told.startswith(
        f"the odometry's clock was set without its own; its stamps are shifted by +{step_s:.0f}"[:-1]
    )


@pytest.mark.parametrize("scan_ns", [25 * MS, 200 * MS, 3000 * MS])
@pytest.mark.parametrize("step_s", [-3600.0, -5.0, -1.5, 1.8, 5.0, 40.0])
def test_clocks_that_are_set_together_stay_together(step_s: float, scan_ns: int) -> None:
    both = set_by(step_s)
    drive = Drive(both, both, scan_ns=scan_ns).run()
    assert max(drive.errors_ns(right if step_s < 0 else both)) == 0
    assert len(drive.reasons()) <= 2 * CONFIG.lasting_messages * ODOMETRY_NS // scan_ns + 1
    assert len(drive.told()) <= (step_s < 0) * (scan_ns < ODOMETRY_NS)  # it is sure of it before the odometry is


def test_several_steps_of_both_are_told_apart() -> None:
    odometry, laser = set_by(-7.0, 15.0), set_by(4.0, 45.0, set_by(-3.0, 10.0, set_by(-7.0, 30.0)))
    drive = Drive(odometry, laser).run()
    assert max(drive.errors_ns()) <= ODOMETRY_NS
    assert [told.split(";")[0] for told in drive.told()] == [
        f"its clock was set {by} s" for by in ("back by 3.000", "back by 7.000", "forward by 4.000")
    ]
    assert len(drive.reasons()) == 3 * DROPPED


def test_a_laser_that_restarts_with_another_clock_is_placed_by_its_lag() -> None:
    drive = Drive(laser=set_by(-1e6), pauses=(("laser", 20.0, 27.3),)).run()
    assert max(drive.errors_ns()) <= ODOMETRY_NS
    assert drive.reasons() == [DropReason.STAMP_BACK] * DROPPED


@pytest.mark.parametrize(
    "pauses",
    [
        (("laser", 20.0, 28.0),),
        (("odometry", 20.0, 28.0),),
        (("laser", 20.0, 28.0), ("odometry", 20.0, 28.0)),
        (("laser", 20.0, 40.0), ("odometry", 23.0, 28.0)),
        (("odometry", 20.0, 60.0), ("laser", 25.0, 33.0)),
    ],
)
@pytest.mark.parametrize("latency_ns", [0, 30 * MS])
def test_pauses_are_no_steps(pauses: tuple[tuple[str, float, float], ...], latency_ns: int) -> None:
    drive = Drive(pauses=pauses, latency_ns=latency_ns).run()
    assert (max(drive.errors_ns()), drive.told()) == (0, [])
    together = len(pauses) == 2 and pauses[0][1:] == pauses[1][1:]
    assert len(drive.reasons()) <= together * (latency_ns == 0)  # a scan that comes before the odometry that is as new


def test_a_single_stamp_far_off_is_dropped_alone() -> None:
    for off_s in (-100.0, 100.0, 7.0):
        drive = Drive(laser=lambda ns, off=off_s: right(ns) + (round(off * S) if ns == 20 * S else 0)).run()
        assert max(drive.errors_ns()) == 0
        assert len(drive.reasons()) == 1
        assert drive.told() == []


@pytest.mark.parametrize("shown", [0, START + 7 * S, START + 61 * S])
@pytest.mark.parametrize("from_s", [0.0, 30.0])
def test_stamps_that_do_not_move_are_those_of_the_odometry(from_s: float, shown: int) -> None:
    drive = Drive(laser=lambda ns: shown if ns >= from_s * S else right(ns)).run()
    placed = [s for true_ns, s in drive.scans if true_ns >= from_s * S][CONFIG.lasting_messages :]
    assert all(s.dropped is None for s in placed)
    assert max(drive.errors_ns()[-100:]) <= ODOMETRY_NS
    assert [told.split(",")[0] for told in drive.told()] == ["its stamps do not move"]


def test_stamps_of_whole_seconds_are_those_of_the_odometry() -> None:
    drive = Drive(laser=lambda ns: right(ns) // S * S, scan_ns=50 * MS).run()
    assert max(drive.errors_ns()[20:]) <= ODOMETRY_NS
    assert len(drive.reasons()) < 30


def test_parts_of_a_sweep_that_share_its_stamp_are_no_stamps_that_stand_still() -> None:
    drive = Drive(laser=lambda ns: right(ns) // (400 * MS) * (400 * MS), scan_ns=40 * MS).run()
    assert drive.told() == []
    assert set(drive.reasons()) == {DropReason.DUPLICATE}


def test_stamps_that_move_again_are_believed() -> None:
    drive = Drive(laser=lambda ns: 0 if ns < 30 * S else right(ns)).run()
    assert max(drive.errors_ns()[-100:]) == 0
    assert [told.split(",")[0] for told in drive.told()] == ["its stamps do not move", "its stamps move again"]


def test_a_scan_that_is_sent_again_and_again_is_used_once() -> None:
    base = TimeBase(CONFIG)
    clock = SensorClock(CONFIG, base)
    reasons = []
    for k in range(50):
        base.accept(START + k * SCAN_NS)
        reasons.append(clock.accept(START, lambda: b"").dropped)
    assert reasons == [None] + [DropReason.DUPLICATE] * 49


def test_without_odometry_stamps_that_do_not_move_are_duplicates() -> None:
    clock = SensorClock(CONFIG, TimeBase(CONFIG))
    reasons = [clock.accept(0, lambda k=k: bytes([k])).dropped for k in range(50)]
    assert reasons == [None] + [DropReason.DUPLICATE] * 49


@settings(deadline=None)
@given(
    st.lists(
        st.tuples(st.booleans(), st.one_of(st.integers(-(10**12), 10**12), st.integers(0, LAST_LEAP_NS + 10**18))),
        max_size=80,
    )
)
def test_no_stamps_do_harm(messages: list[tuple[bool, int]]) -> None:
    base = TimeBase(CONFIG)
    clock = SensorClock(CONFIG, base)
    for of_odometry, stamp_ns in messages:
        stamped = base.accept(stamp_ns) if of_odometry else clock.accept(stamp_ns, lambda ns=stamp_ns: str(ns).encode())
        assert isinstance(stamped.stamp_ns, int)
        assert bool(stamped.told) <= (stamped.dropped is None)
