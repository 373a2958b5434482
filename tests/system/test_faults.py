"""What robots really send: a fault is one clear line, or a count, and the rest of the drive is as good as without."""

import math
from pathlib import Path

import numpy as np
import pytest
from drives import RESULT_FILES, Simulated, ate_m, change, lines, run, write
from faulty.faults import (
    NO_LASER,
    OFF,
    WHEELS_M,
    Fault,
    all_of,
    altered,
    at_pose,
    clock_complaints,
    clock_set_back,
    clock_set_back_twice,
    emptied,
    half_silent_scan,
    laser_complaint,
    non_finite,
    readings,
    repeated,
    reset_odometry,
    silent_scan,
    some_of,
)

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.lidar.laser_watch import FEW_RETURNS, LATE
from wayfi.frontends.measurements import LaserScan, Odometry, StaticTransforms, WifiScan
from wayfi.recordings.files.tum import read_tum

MALFORMED = ["", "aa:bb:cc:dd:ee", "aa:bb:cc:dd:ee:fg", "not a bssid", "aa:bb:cc:dd:ee:ff:00"]
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
        warnings=("odometry: its clock was set back by 10.000 s; its stamps are shifted by +10.000 s from here on",),
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
        warnings=("odometry: its clock was set back by 10.000 s; its stamps are shifted by +10.000 s from here on",),
        settings=OFF,
    ),
    "clock set back twice": Fault(
        clock_set_back_twice,
        {"/odom": {"stamp_jumped_back": 8}, "/scan": {"stamp_jumped_back": 8}, "/wifi": {"stamp_jumped_back": 2}},
        poses=593,
        warnings=(
            "odometry: its clock was set back by 10.000 s; its stamps are shifted by +10.000 s from here on",
            "odometry: its clock was set back by 5.000 s; its stamps are shifted by +15.000 s from here on",
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
        warnings=(
            *laser_complaint(LATE),
            "/scan: 50 of its 50 messages are not used: their stamps are -34.9 s from the odometry's newest, "
            "which is too old; send them sooner, or synchronise the clocks",
            "/scan: its messages are used again",
            *laser_complaint(LATE, ends=True)[1:],
        ),
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
        all_of(LaserScan, lambda a: a.stamped(100.0)),
        {"/scan": {"ahead_of_odometry": 600}},
        bound_m=WHEELS_M,
        warnings=(
            "/scan: 50 of its 50 messages are not used: their stamps are +99.9 s from the odometry's newest; "
            "synchronise the clocks",
        ),
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
            "no /tf_static says where 'laser' is mounted; base_link is assumed (see lidar.mount)",
        ),
    ),
    "odometry stops": Fault(
        lambda drive: [a for a in drive.arrivals if not (isinstance(a.measurement, Odometry) and a.second > 30.01)],
        {},
        poses=301 + 299,  # scans are stamped like odometry, and the last sweep ends within the drive
        warnings=(NO_LASER,),
    ),
    "odometry pauses": Fault(
        lambda drive: [a for a in drive.arrivals if not (isinstance(a.measurement, Odometry) and 30 < a.second < 45)],
        {},
        poses=301 + 149 + 151,
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
