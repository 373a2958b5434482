"""Faults of what robots send, made from a simulated drive, and what the command line says where it refuses one."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from drives import Arrival, Simulated, change
from typer.testing import CliRunner

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.lidar.laser_watch import ENDS, complaint_texts
from wayfi.frontends.lidar.lidar_config import LaserWatchConfig
from wayfi.frontends.measurements import LaserScan, Odometry, WifiScan
from wayfi.service.cli.app import app

LASER_M = 0.05  # ATE of the minute with the laser; 0.005 without faults
WHEELS_M = 0.4  # as above, by wheels and WiFi alone; 0.13 without faults
OFF = ("lidar.enabled=false",)


NO_LASER = "no odometry: the laser leads"
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
