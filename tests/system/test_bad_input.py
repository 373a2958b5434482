"""What robots really send: a fault is one clear line, or a count, and the rest of the drive is as good as without."""

import math
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drives import RESULT_FILES, Arrival, Simulated, ate_m, change, lines, run, write
from rerun.chunk import RrdReader
from typer.testing import CliRunner

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.lidar.laser_watch import ENDS, FEW_RETURNS, LATE, complaint_texts
from wayfi.frontends.lidar.lidar_config import LaserWatchConfig
from wayfi.frontends.measurements import LaserScan, Odometry, StaticTransforms, WifiScan
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import McapWriter
from wayfi.service.cli.app import app

LASER_M = 0.05  # ATE of the minute with the laser; 0.005 without faults
WHEELS_M = 0.4  # as above, by wheels and WiFi alone; 0.13 without faults
OFF = ("lidar.enabled=false",)
Faulty = Callable[[Simulated], list[Arrival]]


@dataclass(frozen=True)
class Fault:
    """What is done to the drive, and what has to come of it."""

    make: Faulty
    dropped: dict[str, dict[str, int]]
    bound_m: float = LASER_M
    poses: int = 601
    warnings: tuple[str, ...] = ()
    settings: tuple[str, ...] = ()


def altered(arrival: Arrival, **fields: Any) -> Arrival:  # noqa: ANN401 - of any field
    measurement: Any = arrival.measurement
    return replace(arrival, measurement=replace(measurement, **fields))


def at_pose(pose: Pose2) -> Callable[[Arrival], Arrival]:
    return lambda arrival: altered(arrival, pose=pose)


def all_of(kind: type, how: Callable[[Arrival], Arrival], from_s: float = 0.0) -> Faulty:
    def faulty(drive: Simulated) -> list[Arrival]:
        return [how(a) if isinstance(a.measurement, kind) and a.second >= from_s else a for a in drive.arrivals]

    return faulty


def clock_complaints(where: str) -> tuple[str, ...]:
    """What is said of the two phones."""
    advice = "its scans are not used (set its clock, or send them sooner)"
    return tuple(f"WiFi receiver 'phone_{n}': its stamps are {where} the odometry's; {advice}" for n in "ab")


def laser_complaint(fault: str, ends: bool = False) -> tuple[str, ...]:
    """What is said of the laser."""
    return (f"laser: {complaint_texts(LaserWatchConfig())[fault]}",) + ((f"laser: {ENDS[fault]}",) if ends else ())


def some_of(kind: Any, numbers: list[int], how: Callable[[Arrival], Arrival]) -> Faulty:  # noqa: ANN401 - a class
    return lambda drive: change(drive.arrivals, kind, numbers, how)


def non_finite(drive: Simulated) -> list[Arrival]:
    nan = change(drive.arrivals, Odometry, [0, 50, 51], at_pose(Pose2(math.nan, 0.0, 0.0)))
    turned = change(nan, Odometry, [200], at_pose(Pose2(0.0, 0.0, math.nan)))
    return change(turned, Odometry, [300, 400], at_pose(Pose2(0.0, math.inf, 0.0)))


def repeated(drive: Simulated) -> list[Arrival]:
    odometry, scans, wifi = (
        [a for a in drive.arrivals if isinstance(a.measurement, kind)] for kind in (Odometry, LaserScan, WifiScan)
    )
    again = [a.delayed(0.001) for a in [*odometry[100:107], *scans[40:45], *wifi[10:12]]]
    return [*drive.arrivals, *again]


def clock_set_back(drive: Simulated) -> list[Arrival]:
    return [a.stamped(-10.0) if a.second >= 30.0 else a for a in drive.arrivals]


def clock_set_back_twice(drive: Simulated) -> list[Arrival]:
    return [a.stamped(-10.0 if a.second < 45.0 else -15.0) if a.second >= 30.0 else a for a in drive.arrivals]


def reset_odometry(drive: Simulated) -> list[Arrival]:
    before: Any = [a.measurement for a in drive.arrivals if isinstance(a.measurement, Odometry) and a.second < 30.0]
    back = before[-1].pose.inverse()

    def reset(arrival: Arrival) -> Arrival:
        measurement: Any = arrival.measurement
        return altered(arrival, pose=back @ measurement.pose)

    return all_of(Odometry, reset, 30.0)(drive)


def silent_scan(arrival: Arrival) -> Arrival:
    """Nothing but inf, NaN, zeros, too near and too far."""
    measurement: Any = arrival.measurement
    ranges = np.resize(np.array([np.inf, np.nan, 0.0, 1e-3, 1e4, -np.inf], np.float32), len(measurement.ranges))
    return altered(arrival, ranges=ranges)


def half_silent_scan(arrival: Arrival) -> Arrival:
    measurement: Any = arrival.measurement
    ranges = measurement.ranges.copy()
    ranges[::2] = np.nan
    return altered(arrival, ranges=ranges)


def readings(bssids: list[str], rssi: list[float]) -> Callable[[Arrival], Arrival]:
    """A scan with these readings, each of it dropped, beside its own; without its own where there are none."""

    def how(arrival: Arrival) -> Arrival:
        measurement: Any = arrival.measurement
        levels = np.array(rssi, np.float32)
        return altered(
            arrival,
            bssids=(*measurement.bssids, *bssids),
            rssi=np.concatenate([measurement.rssi, levels]),
            age_s=np.concatenate([measurement.age_s, 0 * np.ones(len(bssids), np.float32)]),
            ssids=(),
            frequency_mhz=(),
        )

    return how


def emptied(arrival: Arrival) -> Arrival:
    none = np.empty(0, np.float32)
    return altered(arrival, bssids=(), rssi=none, age_s=none, ssids=(), frequency_mhz=())


def garbage(data: bytes) -> Callable[[Arrival], Arrival]:
    return lambda arrival: replace(arrival, data=data)


MALFORMED = ["", "aa:bb:cc:dd:ee", "aa:bb:cc:dd:ee:fg", "not a bssid", "aa:bb:cc:dd:ee:ff:00"]
NO_LASER = "no odometry: the laser leads"
FAULTS = {
    "none": Fault(lambda drive: list(drive.arrivals), {}),
    "non-finite odometry": Fault(
        # the first pose is one of them, so that the first scan is earlier than all odometry
        non_finite,
        {"/odom": {"non_finite": 6}, "/scan": {"too_late": 1}},
        poses=595,
    ),
    "stamps of odometry half a second back": Fault(
        some_of(Odometry, [100, 200, 300], lambda a: a.stamped(-0.55)), {"/odom": {"stamp_jumped_back": 3}}, poses=598
    ),
    "stamps of odometry 20 s back, singly": Fault(
        some_of(Odometry, [250, 252, 300], lambda a: a.stamped(-20.0)), {"/odom": {"stamp_jumped_back": 3}}, poses=598
    ),
    "stamps of scans and WiFi back, singly": Fault(
        lambda drive: change(
            change(drive.arrivals, LaserScan, [100, 400], lambda a: a.stamped(-3.05)),
            WifiScan,
            [20],
            lambda a: a.stamped(-10.0),
        ),
        {"/scan": {"stamp_jumped_back": 2}, "/wifi": {"stamp_jumped_back": 1}},
    ),
    "stamps of zero": Fault(
        some_of(Odometry, [100, 101], lambda a: altered(a, stamp_ns=0)), {"/odom": {"stamp_jumped_back": 2}}, poses=599
    ),
    "clock set back by 10 s": Fault(
        clock_set_back,
        {"/odom": {"stamp_jumped_back": 4}, "/scan": {"stamp_jumped_back": 4}, "/wifi": {"stamp_jumped_back": 1}},
        poses=597,
        warnings=("the clock was set back: stamps are shifted by +10.000 s from here on",),
    ),
    "clock set back by 10 s, without the laser": Fault(
        clock_set_back,
        {
            "/odom": {"stamp_jumped_back": 4},
            "/scan": {"sensor_off": 600},
            "/wifi": {"stamp_jumped_back": 1},
        },
        bound_m=WHEELS_M,
        poses=597,
        warnings=("the clock was set back: stamps are shifted by +10.000 s from here on",),
        settings=OFF,
    ),
    "clock set back twice": Fault(
        clock_set_back_twice,
        {"/odom": {"stamp_jumped_back": 8}, "/scan": {"stamp_jumped_back": 8}, "/wifi": {"stamp_jumped_back": 2}},
        poses=593,
        warnings=(
            "the clock was set back: stamps are shifted by +10.000 s from here on",
            "the clock was set back: stamps are shifted by +15.000 s from here on",
        ),
    ),
    "repeated messages": Fault(
        repeated, {"/odom": {"duplicate": 7}, "/scan": {"duplicate": 5}, "/wifi": {"duplicate": 2}}
    ),
    "scans a second late": Fault(all_of(LaserScan, lambda a: a.delayed(1.0)), {}),
    "scans half a minute late": Fault(
        all_of(LaserScan, lambda a: a.delayed(35.0)),
        {"/scan": {"too_late": 300}},
        bound_m=WHEELS_M,
        warnings=laser_complaint(LATE, ends=True),
    ),
    "WiFi half a minute late": Fault(
        all_of(WifiScan, lambda a: a.delayed(35.0)),
        {"/wifi": {"clock_off": 60}},
        warnings=clock_complaints("34.9 s behind"),
    ),
    "a scan come in after the next ones": Fault(
        some_of(LaserScan, [100], lambda a: a.delayed(0.35)), {"/scan": {"stamp_jumped_back": 1}}
    ),
    "scans without a return": Fault(
        some_of(LaserScan, list(range(100, 120)), silent_scan),
        {"/scan": {"no_return": 20}},
        warnings=laser_complaint(FEW_RETURNS, ends=True),
    ),
    "nothing but scans without a return": Fault(
        all_of(LaserScan, silent_scan),
        {"/scan": {"no_return": 600}},
        bound_m=WHEELS_M,
        warnings=laser_complaint(FEW_RETURNS),
    ),
    "half of all beams without a return": Fault(all_of(LaserScan, half_silent_scan), {}),
    "WiFi scans without readings": Fault(some_of(WifiScan, [3, 30, 59], emptied), {"/wifi": {"no_readings": 3}}),
    "malformed BSSIDs": Fault(
        some_of(WifiScan, [3, 30], readings(MALFORMED, [-50.0] * 5)), {"/wifi": {"malformed_bssid": 10}}
    ),
    "absurd RSSI": Fault(
        some_of(WifiScan, [3], readings(["aa:bb:cc:dd:ee:ff"] * 4, [5.0, -120.5, math.nan, -math.inf])),
        {"/wifi": {"absurd_rssi": 4}},
    ),
    "nothing but malformed BSSIDs": Fault(
        some_of(WifiScan, [3], lambda a: readings(MALFORMED, [-50.0] * 5)(emptied(a))),
        {"/wifi": {"malformed_bssid": 5, "no_readings": 1}},
    ),
    "odometry reset to zero": Fault(
        reset_odometry, {}, warnings=("the odometry leapt further than a robot drives; the leap counts as no motion",)
    ),
    "one wild odometry pose": Fault(
        some_of(Odometry, [300], at_pose(Pose2(1e6, -1e6, 0.0))),
        {},
        warnings=(
            "the odometry leapt further than a robot drives; the leap counts as no motion",
            "2 times: the odometry leapt further than a robot drives; the leap counts as no motion",
        ),
    ),
    "the laser's clock far ahead": Fault(
        all_of(LaserScan, lambda a: a.stamped(100.0)), {"/scan": {"ahead_of_odometry": 600}}, bound_m=WHEELS_M
    ),
    "the phones' clocks far ahead": Fault(
        all_of(WifiScan, lambda a: a.stamped(100.0)),
        {"/wifi": {"clock_off": 60}},
        warnings=clock_complaints("100.0 s ahead of"),
    ),
    "no odometry": Fault(lambda drive: drive.without(Odometry), {}, poses=600, warnings=(NO_LASER,)),
    "no odometry, and nobody knows where the laser is": Fault(
        lambda drive: drive.without(Odometry, WifiScan, StaticTransforms),
        {},
        bound_m=0.2,  # the lever of 0.2 m to base_link is in it
        poses=600,
        warnings=(
            NO_LASER,
            "no /tf_static says where 'laser' is mounted; taken to be at base_link (see lidar.mount)",
        ),
    ),
    "odometry stops": Fault(
        lambda drive: [a for a in drive.arrivals if not (isinstance(a.measurement, Odometry) and a.second > 30.01)],
        {},
        poses=301 + 300,
        warnings=(NO_LASER,),
    ),
    "odometry pauses": Fault(
        lambda drive: [a for a in drive.arrivals if not (isinstance(a.measurement, Odometry) and 30 < a.second < 45)],
        {},
        poses=301 + 150 + 151,
        warnings=(NO_LASER, "odometry has come: the wheels lead from here on, not the laser"),
    ),
    "odometry ends before the last scan": Fault(
        lambda drive: [a for a in drive.arrivals if not (isinstance(a.measurement, Odometry) and a.second > 59.89)],
        {"/scan": {"ahead_of_odometry": 2}},
        poses=599,
    ),
    "no scans": Fault(lambda drive: drive.without(LaserScan), {}, bound_m=WHEELS_M),
    "no WiFi": Fault(lambda drive: drive.without(WifiScan), {}),
    "odometry alone": Fault(lambda drive: drive.without(LaserScan, WifiScan, StaticTransforms), {}, bound_m=WHEELS_M),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_counted_and_the_drive_goes_on(name: str, minute: Simulated, tmp_path: Path) -> None:
    fault, out = FAULTS[name], tmp_path / "out"
    arrivals = fault.make(minute)
    report = run(write(tmp_path / "recording.mcap", arrivals), out, *fault.settings)
    assert report["dropped"] == fault.dropped
    assert report["warnings"] == list(fault.warnings)
    assert sum(report["messages"].values()) == len(arrivals)
    assert {path.name for path in out.iterdir()} >= set(RESULT_FILES) - {"session.rrd"}
    estimate = read_tum(out / "trajectory.tum")
    assert len(estimate) == len(lines(out / "online.tum")) == fault.poses
    assert (np.diff(estimate.stamps_ns) > 0).all()
    assert ate_m(out, minute.truth) < fault.bound_m


UNDECODABLE = {"empty": b"", "a header alone": b"\0\1\0\0", "noise": bytes(range(256)), "no CDR": b"\xff" * 700}


@pytest.mark.parametrize("kind", [Odometry, LaserScan, WifiScan])
@pytest.mark.parametrize("name", UNDECODABLE)
def test_undecodable_messages_are_counted_and_told_once(
    kind: type[Odometry | LaserScan | WifiScan], name: str, minute: Simulated, tmp_path: Path
) -> None:
    topic = {Odometry: "/odom", LaserScan: "/scan", WifiScan: "/wifi"}[kind]
    first = [a for a in minute.arrivals if a.second < 10.01]
    arrivals = change(first, kind, [2, 3, 8], garbage(UNDECODABLE[name]))
    report = run(write(tmp_path / "recording.mcap", arrivals), tmp_path / "out")
    assert report["dropped"] == {topic: {"undecodable": 3}}
    assert [warning.split(":")[0] for warning in report["warnings"]] == [topic]
    assert len(lines(tmp_path / "out" / "trajectory.tum")) == 101 - 3 * (kind is Odometry)


def test_json_where_fields_are_missing_is_undecodable(minute: Simulated, tmp_path: Path) -> None:
    first = [a for a in minute.arrivals if a.second < 10.01]
    spoiled = [
        replace(a, encoding="json", data=b'{"header": {"stamp": {"sec": 1}}}' if a.second < 2 else b"{")
        if isinstance(a.measurement, WifiScan)
        else a
        for a in first
    ]
    report = run(write(tmp_path / "recording.mcap", spoiled), tmp_path / "out")
    assert report["dropped"] == {"/wifi": {"undecodable": 10}}


# Nothing usable


def refused(*arguments: str | Path) -> str:
    """The one line that the command line says where it exits with 1."""
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    assert done.exit_code == 1, done.output
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("wayfi: ")
    return str(line)


def replay_refused(recording: Path, out: Path) -> str:
    return refused("replay", recording, "--out", out)


def test_a_missing_file(tmp_path: Path) -> None:
    line = replay_refused(tmp_path / "nothing.mcap", tmp_path / "out")
    assert line == f"wayfi: {tmp_path / 'nothing.mcap'} does not exist"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("data", "said"), [(b"", "is empty"), (b"PK\3\4 and so on", "is not an MCAP file"), (b"\x89MCAP", "not an MCAP")]
)
def test_a_file_that_is_no_recording(tmp_path: Path, data: bytes, said: str) -> None:
    (tmp_path / "recording.mcap").write_bytes(data)
    assert said in replay_refused(tmp_path / "recording.mcap", tmp_path / "out")


def test_a_folder_without_recordings(tmp_path: Path) -> None:
    assert "is a folder without .mcap files" in replay_refused(tmp_path, tmp_path / "out")


def test_results_cannot_go_where_a_file_is(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.arrivals[:50])
    assert "cannot be made" in replay_refused(recording, recording)


def test_no_usable_topic(tmp_path: Path) -> None:
    with McapWriter(tmp_path / "recording.mcap") as writer:
        writer.write("/chatter", "std_msgs/msg/String", "cdr", 0, b"\0\1\0\0")
    line = replay_refused(tmp_path / "recording.mcap", tmp_path / "out")
    assert "nothing usable on /odom or /scan" in line
    assert "/chatter (no sensor is configured for this topic (type std_msgs/msg/String))" in line


def test_wifi_alone_is_nothing_to_do(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.without(Odometry, LaserScan))
    assert "60 x /wifi no_pose" in replay_refused(recording, tmp_path / "out")


def test_odometry_of_nothing_but_faults(minute: Simulated, tmp_path: Path) -> None:
    faulty = change(minute.without(LaserScan), Odometry, range(601), at_pose(Pose2(math.nan, 0.0, 0.0)))
    recording = write(tmp_path / "recording.mcap", faulty)
    assert "601 x /odom non_finite" in replay_refused(recording, tmp_path / "out")


def test_an_unknown_encoding(minute: Simulated, tmp_path: Path) -> None:
    unknown = [replace(a, encoding="protobuf") if isinstance(a.measurement, Odometry) else a for a in minute.arrivals]
    alone = [a for a in unknown if isinstance(a.measurement, Odometry)]
    said = "unknown encoding protobuf; odom takes cdr or json"
    assert said in replay_refused(write(tmp_path / "alone.mcap", alone), tmp_path / "out")
    report = run(write(tmp_path / "recording.mcap", unknown), tmp_path / "out")
    assert report["warnings"] == [f"/odom: not used: {said}", NO_LASER]
    assert ate_m(tmp_path / "out", minute.truth) < LASER_M


# Cut files


@pytest.fixture(scope="module")
def whole(minute: Simulated, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("whole") / "recording.mcap", minute.arrivals, flush_every=100)


@pytest.mark.parametrize("share", [0.15, 0.5, 0.9, 0.999])
def test_a_cut_file_gives_what_is_complete(whole: Path, tmp_path: Path, share: float) -> None:
    data = whole.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(share * len(data))])
    report = run(cut, tmp_path / "out")
    (warning,) = report["warnings"]
    used = sum(report["messages"].values())
    assert warning == f"cut.mcap is cut off after {used} messages; used what is complete"
    assert used >= (share - 0.1) * 1262
    assert len(lines(tmp_path / "out" / "trajectory.tum")) == report["messages"]["/odom"]
    assert {path.name for path in (tmp_path / "out").iterdir()} >= set(RESULT_FILES) - {"session.rrd"}


@pytest.mark.parametrize("length", [8, 40, 400, 4000])
def test_a_file_cut_before_anything_is_complete(whole: Path, tmp_path: Path, length: int) -> None:
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:length])
    assert "cut.mcap" in replay_refused(tmp_path / "cut.mcap", tmp_path / "out")


def test_a_damaged_chunk_is_left_out(whole: Path, minute: Simulated, tmp_path: Path) -> None:
    data = bytearray(whole.read_bytes())
    data[len(data) // 2] ^= 0xFF
    (tmp_path / "damaged.mcap").write_bytes(data)
    report = run(tmp_path / "damaged.mcap", tmp_path / "out")
    (warning,) = report["warnings"]
    assert warning.startswith("damaged.mcap is damaged at byte")
    assert sum(report["messages"].values()) == 1262 - 100
    assert ate_m(tmp_path / "out", minute.truth) < LASER_M


# Nothing already written is lost


def logged_poses(rrd: Path) -> int:
    """How many moments there are in the log of the robot's place."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "RRD file has no footer")
        chunks = RrdReader(rrd).stream().filter(content="/map/robot").to_chunks()
        return sum(chunk.num_rows for chunk in chunks if not chunk.is_static)


FAILING = """
import sys
from wayfi.service.cli import app as cli
from wayfi.frontends.pipeline import Pipeline
whole, count = Pipeline.process, 0
def process(self, measurement, published):
    global count
    count += 1
    if count == 900:
        raise RuntimeError("out of luck")
    return whole(self, measurement, published)
Pipeline.process = process
sys.argv = ["wayfi", "replay", *sys.argv[1:]]
cli.main()
"""


def test_an_exception_leaves_what_was_logged(whole: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-c", FAILING, str(whole), "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 1
    assert "out of luck" in done.stderr
    assert logged_poses(tmp_path / "session.rrd") > 30


def wait_until_still(path: Path) -> None:
    """Until nothing has been added to a file for two seconds."""
    size = -1
    while path.stat().st_size != size:
        size = path.stat().st_size
        time.sleep(2.0)


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130)])
def test_a_killed_replay_leaves_what_was_logged(whole: Path, tmp_path: Path, sent: signal.Signals, code: int) -> None:
    rrd = tmp_path / "session.rrd"
    command = [sys.executable, "-m", "wayfi.service.cli", "replay", str(whole), "--out", str(tmp_path), "--rate", "10"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not (rrd.exists() and rrd.stat().st_size > 300_000):
            time.sleep(0.02)
        process.send_signal(sent)
        _, error = process.communicate(timeout=60)
    assert (process.returncode, "Traceback" in error) == (code, False), error
    wait_until_still(rrd)  # the process that logs ends the file after the one that was killed
    assert logged_poses(rrd) > 5
