"""What goes wrong with the laser: the estimate survives, nothing wrong enters the graph, the status says what it is."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from wayfi.backend.pose2 import Floats, Pose2, between_all
from wayfi.frontends.complaints import SILENT
from wayfi.frontends.events import ClosureJudged, ClosureKind, Event, KeyframeAdded, Verdict, Warned
from wayfi.frontends.lidar.laser_watch import BLOCKED, FEW_RETURNS, LATE
from wayfi.frontends.measurements import LaserScan, Measurement
from wayfi.frontends.pipeline import Pipeline
from wayfi.recordings.simulation import run as simulation
from wayfi.recordings.simulation.run import EPOCH_NS, T_BASE_LASER, start
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import load_config
from wayfi.service.evaluation.trajectory_scores import absolute_error

S = 1_000_000_000
MINUTES = 6.0
FROM_S, UNTIL_S = 100.0, 160.0  # the minute in which something is wrong
CLOSE_M, CLOSE_RAD = 0.3, 0.05  # of the truth: a right closure
WORSE, PERSON_WORSE = 1.1, 1.5  # than without any scan in that minute
FLOOR_M = 0.005  # what other scans of the same place change
SAME_M = 0.01  # the order of arrival, and beams at the limit, change the rounding of scan matching
ANYHOW_M = 0.1
CLOCK_S, STAMPED_M = 0.05, 0.1
FORGOTTEN_M = 0.25  # what was driven before another clock is corrected is left to wheels that nobody calibrated
FIVE_SECONDS_M = 2.5  # driven in that time, at 0.5 m/s
Fault = Callable[[LaserScan, float], LaserScan | None]


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What came of a drive."""

    ate_m: float
    events: list[Event]
    truth: Trajectory

    def complaints(self) -> list[tuple[str, bool]]:
        """Those about the laser, each with whether it ends."""
        return [(e.complaint, e.ends) for e in self.events if isinstance(e, Warned) and e.complaint]

    def closures(self) -> int:
        """How many laser closures stand in the end."""
        return len(self._errors())

    def wrong_closures(self) -> list[Floats]:
        """Errors of the standing laser closures that are not close to the truth."""
        errors = self._errors()
        return [e for e in errors if math.hypot(e[0], e[1]) > CLOSE_M or abs(e[2]) > CLOSE_RAD]

    def _errors(self) -> list[Floats]:
        last = {e.closure: e for e in self.events if isinstance(e, ClosureJudged)}.values()
        return [self._error(e) for e in last if e.verdict is Verdict.ACCEPTED and e.kind is ClosureKind.LIDAR]

    def _error(self, e: ClosureJudged) -> Floats:
        true = self.truth.at(np.array([e.stamp_a_ns, e.stamp_b_ns]))
        return between_all(between_all(true[0], true[1]), e.T_a_b.array())[0]


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """What was measured on a drive, and what comes of it when nothing is wrong."""

    measurements: list[Measurement]
    truth: Trajectory
    sound: Run
    _known: dict[tuple[Fault, float], Run] = field(default_factory=dict)

    def with_fault(self, fault: Fault, late_s: float = 0.0) -> Run:
        """What comes, made once, of the scans that `fault` makes of them, come in `late_s` after their time."""
        if (fault, late_s) not in self._known:
            self._known[fault, late_s] = self._run(fault, late_s)
        return self._known[fault, late_s]

    def _run(self, fault: Fault, late_s: float) -> Run:
        arrivals = [(m.stamp_ns + late_s * S * isinstance(m, LaserScan), m) for m in self.measurements]
        ordered = [m for _, m in sorted(arrivals, key=lambda arrival: arrival[0])]
        return run([c for m in ordered if (c := _changed(m, fault)) is not None], self.truth)


def run(measurements: list[Measurement], truth: Trajectory) -> Run:
    pipeline = Pipeline(load_config())
    kept = ClosureJudged, KeyframeAdded, Warned
    events = [e for m in measurements for e in pipeline.process(m) if isinstance(e, kept)]
    result, last = pipeline.finish()
    error = absolute_error(Trajectory(result.stamps_ns, result.final), truth).error
    assert error.not_covered == 0
    return Run(error.ate_rmse_m, events + [e for e in last if isinstance(e, kept)], truth)


def _changed(m: Measurement, fault: Fault) -> Measurement | None:
    return fault(m, second(m.stamp_ns)) if isinstance(m, LaserScan) else m


def simulated(mount: Pose2 = T_BASE_LASER) -> Recorded:
    """Six minutes of a typical robot in the car park, some of it driven twice."""
    made = replace(start(World.CARPARK, 0, MINUTES), T_base_laser=mount)
    measurements = list(simulation.measurements(made))
    return Recorded(measurements, made.truth, run(measurements, made.truth))


def second(stamp_ns: int) -> float:
    """Seconds into the drive."""
    return (stamp_ns - EPOCH_NS) / S


@pytest.fixture(scope="module")
def drive() -> Recorded:
    return simulated()


def for_a_minute(fault: Fault) -> Fault:
    return lambda scan, s: fault(scan, s) if FROM_S <= s < UNTIL_S else scan


def filled(low_m: float, high_m: float) -> Fault:
    """Every beam ends between these ranges."""

    def fault(scan: LaserScan, s: float) -> LaserScan:
        rng = np.random.default_rng(round(s * 1000))
        return replace(scan, ranges=rng.uniform(low_m, high_m, len(scan.ranges)).astype(np.float32))

    return fault


def glass(scan: LaserScan, s: float) -> LaserScan:
    lost = np.random.default_rng(round(s * 1000)).random(len(scan.ranges)) < 0.9
    return replace(scan, ranges=np.where(lost, np.float32(np.inf), scan.ranges))


def person(scan: LaserScan, s: float) -> LaserScan:
    """Somebody a metre ahead, over 60 degrees of view, who sways as he walks."""
    bearings = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    body = 1.0 + 0.05 * math.sin(6.0 * s) + 0.1 * bearings**2
    seen = np.where(np.abs(bearings) < math.radians(30.0), np.minimum(body, scan.ranges), scan.ranges)
    return replace(scan, ranges=seen.astype(np.float32))


def silent(_scan: LaserScan, _s: float) -> None:
    return None


def without_return_is(range_m: float) -> Fault:
    """The beams beyond 8 m do not return, and a driver says so by a range."""

    def fault(scan: LaserScan, _: float) -> LaserScan:
        return replace(scan, ranges=np.where(scan.ranges < 8.0, scan.ranges, np.float32(range_m)))

    return fault


def stamped(shift_s: float) -> Fault:
    return lambda scan, _: replace(scan, stamp_ns=scan.stamp_ns + round(shift_s * S))


def sound(scan: LaserScan, _: float) -> LaserScan:
    return scan


def begins_and_ends(fault: str) -> list[tuple[str, bool]]:
    return [(f"laser.{fault}", False), (f"laser.{fault}", True)]


SEEN_AS_NEAR, WITHOUT_SCANS = for_a_minute(filled(0.05, 0.1)), for_a_minute(silent)
TOLD: dict[str, tuple[Fault, str]] = {
    "blocked, seen as near": (SEEN_AS_NEAR, BLOCKED),
    "blocked, below its range": (for_a_minute(filled(0.01, 0.05)), BLOCKED),
    "glass": (for_a_minute(glass), FEW_RETURNS),
    "silent": (WITHOUT_SCANS, SILENT),
}


@pytest.fixture(scope="module")
def without_it(drive: Recorded) -> Run:
    """What comes of the drive when the laser is silent for the minute."""
    return drive.with_fault(WITHOUT_SCANS)


@pytest.fixture(scope="module")
def without_far_returns(drive: Recorded) -> Run:
    """What comes of the drive when beams beyond 8 m do not return, as the message defines it: by inf."""
    return drive.with_fault(without_return_is(math.inf))


def test_the_sound_drive_closes_loops_and_nothing_is_complained_of(drive: Recorded) -> None:
    assert drive.sound.closures() >= 3
    assert drive.sound.wrong_closures() == []
    assert drive.sound.complaints() == []


@pytest.mark.parametrize("name", TOLD)
def test_a_fault_of_a_minute_is_told_and_survived(name: str, drive: Recorded, without_it: Run) -> None:
    fault, told = TOLD[name]
    faulty = drive.with_fault(fault)
    assert faulty.complaints() == begins_and_ends(told)
    assert faulty.ate_m <= WORSE * without_it.ate_m + FLOOR_M
    assert faulty.closures() > 0
    assert faulty.wrong_closures() == []


def test_no_scan_of_a_blocked_laser_becomes_a_keyframes(drive: Recorded) -> None:
    faulty = drive.with_fault(SEEN_AS_NEAR)
    inside = [e for e in faulty.events if isinstance(e, KeyframeAdded) and FROM_S < second(e.stamp_ns) < UNTIL_S]
    assert len(inside) > 5
    assert sum(len(e.points) for e in inside) == 0


def test_a_person_who_walks_along_is_survived(drive: Recorded, without_it: Run) -> None:
    faulty = drive.with_fault(for_a_minute(person))
    assert faulty.ate_m <= PERSON_WORSE * without_it.ate_m
    assert faulty.wrong_closures() == []
    assert faulty.complaints() == []


@pytest.mark.parametrize("range_m", [9.5, 19.99, 20.0, 21.0, 0.0, math.nan])
def test_a_range_that_means_no_return_is_no_wall(range_m: float, drive: Recorded, without_far_returns: Run) -> None:
    faulty = drive.with_fault(without_return_is(range_m))
    assert faulty.ate_m == pytest.approx(without_far_returns.ate_m, abs=SAME_M)
    assert faulty.wrong_closures() == []
    assert faulty.complaints() == []
    grown = [np.hypot(*e.points.T).max() for e in faulty.events if isinstance(e, KeyframeAdded) and len(e.points)]
    assert max(grown) < 8.5


@pytest.mark.parametrize("mount", [Pose2(0.2, 0.0, math.pi), Pose2(0.3, -0.2, 0.7)], ids=["backwards", "off-centre"])
def test_a_laser_may_be_mounted_anyhow(mount: Pose2) -> None:
    made = simulated(mount)
    assert made.sound.ate_m <= ANYHOW_M
    assert made.sound.wrong_closures() == []
    assert made.sound.complaints() == []


def test_scans_that_come_two_seconds_late_are_used_at_their_stamps(drive: Recorded) -> None:
    faulty = drive.with_fault(sound, late_s=2.0)
    assert faulty.complaints()[0] == (f"laser.{LATE}", False)
    assert faulty.ate_m == pytest.approx(drive.sound.ate_m, abs=SAME_M)
    assert faulty.wrong_closures() == []


@pytest.mark.parametrize(("shift_s", "before"), [(-2.0, [(f"laser.{LATE}", False)]), (1.0, [])])
def test_wrong_stamps_are_told_and_corrected(shift_s: float, before: list[tuple[str, bool]], drive: Recorded) -> None:
    faulty = drive.with_fault(stamped(shift_s))
    assert faulty.complaints()[: len(before) + 1] == [*before, ("laser.clock", False)]
    corrected = [e.text for e in faulty.events if isinstance(e, Warned) and e.complaint == "laser.clock"]
    assert len(corrected) == 1
    assert abs(told_s(corrected[0]) + shift_s) < CLOCK_S
    assert faulty.ate_m <= FORGOTTEN_M
    assert faulty.wrong_closures() == []


def test_a_driver_that_stamps_early_or_late_is_corrected_and_nothing_is_forgotten(drive: Recorded) -> None:
    faulty = drive.with_fault(stamped(-0.3))
    corrected = [e.text for e in faulty.events if isinstance(e, Warned) and "its driver stamps its scans" in e.text]
    assert len(corrected) == 1
    early = re.search(r"([\d.]+) s early", corrected[0])
    assert early
    assert abs(float(early[1]) - 0.3) < CLOCK_S
    assert faulty.complaints() == []
    assert faulty.ate_m <= STAMPED_M
    assert faulty.wrong_closures() == []


def told_s(text: str) -> float:
    """What a complaint says is to be added to the laser's stamps, s."""
    found = re.search(r"([\d.]+) s (behind|ahead of) the odometry's", text)
    assert found
    return float(found[1]) * (1.0 if found[2] == "behind" else -1.0)


def test_stamps_too_wrong_to_be_corrected_are_told_and_close_no_loop_wrongly(drive: Recorded) -> None:
    faulty = drive.with_fault(stamped(-5.0))
    assert faulty.complaints() == [(f"laser.{LATE}", False)]
    assert faulty.ate_m <= FIVE_SECONDS_M
    assert faulty.wrong_closures() == []
