"""What goes wrong with WiFi: the estimate is never worse than without WiFi, and the status says what is wrong."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from heapq import merge
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drives import Simulated, change, write
from drives import run as replayed

from wayfi.backend.graph.health import State
from wayfi.frontends.complaints import SILENT
from wayfi.frontends.events import Dropped, DropReason, Event, FingerprintAdded, StateChanged, Warned
from wayfi.frontends.measurements import LaserScan, Measurement, Sensor, WifiScan
from wayfi.frontends.odometry.odometry_config import ClockConfig
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.wifi.wifi_config import WifiWatchConfig
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import Encoding
from wayfi.recordings.simulation.run import odometry, start, wifi_scans
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import load_config
from wayfi.service.daemon.diagnostics import Diagnostics
from wayfi.service.evaluation.trajectory_scores import absolute_error
from wayfi.service.transport.message_queue import MessageQueue, limits_of
from wayfi.service.transport.output_messages import OK, WARN

WORSE = 1.1
FLOOR_M = 0.005  # of the drive with the laser: what other WiFi scans of the same place change
SOUND = "wifi_0"  # the receiver of the real recordings
KEPT = (Dropped, FingerprintAdded, Warned)
SENSORS = {topic: sensor for sensor, topic in DEFAULT_TOPICS.items()}
Faulty = Callable[[WifiScan, float], WifiScan | None]


# Drives


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What came of a drive."""

    ate_m: float
    events: list[Event]

    @property
    def warnings(self) -> list[Warned]:
        """Those about WiFi receivers."""
        return [e for e in self.events if isinstance(e, Warned) and e.complaint]

    @property
    def refused(self) -> list[DropReason]:
        """Why WiFi scans were dropped."""
        return [e.reason for e in self.events if isinstance(e, Dropped) and e.sensor is Sensor.WIFI]

    def heard(self, receiver: str) -> list[tuple[int, tuple[str, ...]]]:
        """The fingerprints of a receiver: when, and which BSSIDs."""
        return [
            (e.stamp_ns, e.bssids) for e in self.events if isinstance(e, FingerprintAdded) and e.receiver == receiver
        ]


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """What was measured on a drive, the truth of it, and what comes of it without WiFi."""

    measurements: list[Measurement]
    truth: Trajectory
    alone: Run
    _known: dict[tuple[Faulty, bool], Run] = field(default_factory=dict)

    def with_fault(self, fault: Faulty, beside: bool = False) -> Run:
        """What comes, made once, of the WiFi that `fault` makes of it; `beside` the sound one, as another receiver."""
        if (fault, beside) not in self._known:
            self._known[fault, beside] = run(list(self._changed(fault, beside)), self.truth)
        return self._known[fault, beside]

    def _changed(self, fault: Faulty, beside: bool) -> Iterator[Measurement]:
        start_ns = self.measurements[0].stamp_ns
        for m in self.measurements:
            if beside or not isinstance(m, WifiScan):
                yield m
            if isinstance(m, WifiScan):
                sent = replace(m, receiver="faulty") if beside else m
                if changed := fault(sent, (m.stamp_ns - start_ns) * 1e-9):
                    yield changed


def run(measurements: list[Measurement], truth: Trajectory, *settings: str) -> Run:
    pipeline = Pipeline(load_config((), settings))
    events = [e for m in measurements for e in pipeline.process(m) if isinstance(e, KEPT)]
    result, _ = pipeline.finish()
    return Run(absolute_error(Trajectory(result.stamps_ns, result.final), truth).error.ate_rmse_m, events)


def measured(recording: Path, seconds: float) -> list[Measurement]:
    source = open_recording(recording)
    end_ns = source.start_ns + round(seconds * 1e9)
    used = ((r, SENSORS[r.topic]) for r in source if r.log_time_ns <= end_ns and r.topic in SENSORS)
    return [decode(r.data, sensor, Encoding(r.encoding)) for r, sensor in used]


def recorded(measurements: list[Measurement], truth: Trajectory) -> Recorded:
    return Recorded(measurements, truth, run(measurements, truth, "wifi.enabled=false"))


def real(name: str, seconds: float, request: pytest.FixtureRequest) -> Recorded:
    folder: Path = request.getfixturevalue("real_data") / name
    return recorded(measured(folder / "recording.mcap", seconds), read_tum(folder / "truth.tum"))


@pytest.fixture(scope="module")
def wheels(request: pytest.FixtureRequest) -> Recorded:
    """Twelve minutes of a real robot without a laser."""
    return real("b14test1", 1e4, request)


@pytest.fixture(scope="module")
def laser(request: pytest.FixtureRequest) -> Recorded:
    """Twelve minutes of a real robot with a laser; the WiFi is simulated."""
    return real("intel_wifi", 720.0, request)


@pytest.fixture(scope="module")
def phones() -> Recorded:
    """Six simulated minutes without a laser, some of it driven twice; two phones, readings of all ages."""
    made = start(World.CARPARK, 0, 6.0)
    return recorded(list(merge(odometry(made), wifi_scans(made), key=stamp_of)), made.truth)


@pytest.fixture(scope="module", params=["wheels", "laser", "phones"])
def drive(request: pytest.FixtureRequest) -> Recorded:
    made: Recorded = request.getfixturevalue(request.param)
    return made


# Faults


def sound(scan: WifiScan, _: float) -> WifiScan:
    return scan


def constant(scan: WifiScan, _: float) -> WifiScan:
    return replace(scan, rssi=np.full(len(scan.rssi), -50.0, np.float32))


def frozen_from(second: float) -> Faulty:
    """The driver gives its last scan again and again."""
    last: dict[str, WifiScan] = {}

    def fault(scan: WifiScan, s: float) -> WifiScan:
        if s < second:
            last[scan.receiver] = scan
        return replace(last.setdefault(scan.receiver, scan), stamp_ns=scan.stamp_ns)

    return fault


def clock_off(shift_s: float, from_s: float = 0.0) -> Faulty:
    shift_ns = round(shift_s * 1e9)
    return lambda scan, s: replace(scan, stamp_ns=scan.stamp_ns + shift_ns) if s >= from_s else scan


def names(count: int, seed: int) -> tuple[str, ...]:
    numbers = np.random.default_rng(seed).integers(0, 256, (count, 5))
    return tuple("02:" + ":".join(f"{byte:02x}" for byte in row) for row in numbers.tolist())


def flooded(in_scan: Callable[[float], bool], seed: Callable[[WifiScan], int]) -> Faulty:
    """Readings of BSSIDs that nobody has, beside the true ones."""

    def fault(scan: WifiScan, s: float) -> WifiScan:
        more = 1500 - len(scan.bssids)
        rssi = np.random.default_rng(seed(scan)).uniform(-90, -40, more).astype(np.float32)
        crowded: Any = replace(
            scan,
            bssids=(*scan.bssids, *names(more, seed(scan))),
            rssi=np.concatenate([scan.rssi, rssi]),
            age_s=np.concatenate([scan.age_s, np.zeros(more, np.float32)]),
            ssids=(),
            frequency_mhz=(),
        )
        return crowded if in_scan(s) else scan

    return fault


def stamp_of(m: Measurement) -> int:
    return m.stamp_ns


def randomised(scan: WifiScan, _: float) -> WifiScan:
    return replace(scan, bssids=names(len(scan.bssids), scan.stamp_ns))


def stops_for_ten_minutes(scan: WifiScan, s: float) -> WifiScan | None:
    return None if 60.0 <= s < 660.0 else scan


FAULTS: dict[str, tuple[Faulty, str]] = {
    "one level for all": (constant, DropReason.CONSTANT_LEVELS),
    "frozen": (frozen_from(0.0), DropReason.CONSTANT_LEVELS),
    "freezes": (frozen_from(70.0), DropReason.CONSTANT_LEVELS),
    "a clock 5 s behind": (clock_off(-5.0), DropReason.CLOCK_OFF),
    "a clock 5 s ahead": (clock_off(5.0), DropReason.CLOCK_OFF),
    "one scan of 1500 readings": (flooded(lambda s: 90.0 <= s < 91.0, stamp_of), DropReason.TOO_MANY_READINGS),
    "1500 readings in every scan": (flooded(lambda _: True, lambda _: 1), DropReason.TOO_MANY_READINGS),
    "randomised BSSIDs": (randomised, DropReason.RANDOMISED_BSSIDS),
    "ten minutes of silence": (stops_for_ten_minutes, SILENT),
}


@pytest.mark.parametrize("name", FAULTS)
def test_it_is_told_and_no_worse_than_without_wifi(name: str, drive: Recorded) -> None:
    fault, told = FAULTS[name]
    faulty = drive.with_fault(fault)
    assert faulty.ate_m <= WORSE * drive.alone.ate_m + FLOOR_M
    complaints = {w.complaint.split(".", 1)[1] for w in faulty.warnings if not w.ends}
    assert complaints == {told}
    assert told == SILENT or told in faulty.refused


@pytest.mark.parametrize("fault", [constant, clock_off(5.0), randomised], ids=["constant", "clock", "randomised"])
def test_a_faulty_receiver_does_not_disturb_a_sound_one(fault: Faulty, wheels: Recorded) -> None:
    clean, both = wheels.with_fault(sound), wheels.with_fault(fault, beside=True)
    assert clean.ate_m < wheels.alone.ate_m
    assert both.ate_m <= WORSE * clean.ate_m
    assert both.heard(SOUND) == clean.heard(SOUND)
    assert {w.complaint.split(".", 1)[0] for w in both.warnings} == {"faulty"}


@pytest.mark.parametrize("step_s", [-5.3, 8.0])
def test_a_clock_that_is_set_is_followed(step_s: float, drive: Recorded) -> None:
    clean, faulty = drive.with_fault(sound), drive.with_fault(clock_off(step_s, 70.0))
    receivers = {m.receiver for m in drive.measurements if isinstance(m, WifiScan)}
    told = [e.text for e in faulty.events if isinstance(e, Warned) and "its clock was set" in e.text]
    assert len(told) == len(receivers)
    assert len(faulty.refused) <= 4 * ClockConfig().lasting_messages * len(receivers)  # odometry comes every 4 s
    assert faulty.warnings == clean.warnings
    assert faulty.ate_m <= WORSE * clean.ate_m + FLOOR_M


def test_wifi_works_again_after_ten_minutes_of_silence(wheels: Recorded) -> None:
    faulty = wheels.with_fault(stops_for_ten_minutes)
    begins, ends = faulty.warnings
    assert f"no scan for {WifiWatchConfig().silent_s:g} s" in begins.text
    assert (begins.complaint, begins.ends, ends.ends) == (ends.complaint, False, True)
    heard_s = [(stamp_ns - wheels.measurements[0].stamp_ns) * 1e-9 for stamp_ns, _ in faulty.heard(SOUND)]
    assert len([s for s in heard_s if s < 60.0]) >= 3
    assert len([s for s in heard_s if s > 660.0]) >= 3


def test_a_sound_receiver_is_not_complained_of(drive: Recorded) -> None:
    clean = drive.with_fault(sound)
    assert (clean.warnings, clean.refused) == ([], [])


def test_randomised_bssids_hardly_get_into_the_index(wheels: Recorded) -> None:
    assert len(wheels.with_fault(randomised).heard(SOUND)) <= 3


def test_the_report_says_what_is_wrong(minute: Simulated, tmp_path: Path) -> None:
    arrivals = change(minute.without(LaserScan), WifiScan, range(60), lambda a: a.stamped(-5.0))
    report = replayed(write(tmp_path / "recording.mcap", arrivals), tmp_path / "out")
    assert report["dropped"] == {"/wifi": {DropReason.CLOCK_OFF: 60}}
    assert all("s behind the odometry's" in warning for warning in report["warnings"])
    assert [warning.split("'")[1] for warning in report["warnings"]] == ["phone_a", "phone_b"]


@pytest.mark.parametrize("name", ["one scan of 1500 readings", "ten minutes of silence", "randomised BSSIDs"])
def test_the_daemons_status_warns_while_a_fault_lasts(name: str, wheels: Recorded) -> None:
    config = load_config()
    limits = limits_of(config.zenoh, config.recording.every_topic)
    diagnostics = Diagnostics(MessageQueue(limits), MessageQueue(limits))
    diagnostics.handle(StateChanged(0, State.TRACKING, "by odometry"), 0.0)
    assert diagnostics.status({}).level == OK
    lasting: dict[str, str] = {}
    for warned in wheels.with_fault(FAULTS[name][0]).warnings:
        diagnostics.handle(warned, 0.0)
        assert diagnostics.due()
        if warned.ends:
            del lasting[warned.complaint]
        else:
            lasting[warned.complaint] = warned.text
        status = diagnostics.status({})
        assert status.level == (WARN if lasting else OK)
        assert all(text in status.message for text in lasting.values())
        told = {key: value for key, value in status.values.items() if key.startswith("complaint.")}
        assert told == {f"complaint.{complaint}": text for complaint, text in lasting.items()}
    assert ("randomised" in name) == bool(lasting)
