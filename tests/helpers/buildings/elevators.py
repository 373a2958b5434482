"""Drives on several floors: simulated drives, joined by rides in an elevator."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from drives import Arrival

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, LaserScan, Odometry, StaticTransforms, WifiScan

RIDE_S = 20
CABIN_M = 2.2  # its side
ATTENUATED_DB = 15.0  # by the cabin


def ridden(parts: Sequence[Sequence[Arrival]]) -> list[Arrival]:
    """The parts one after another, the wheels going on; between two of them the robot stands in a cabin.

    WiFi hears the floor that was left for the first half of a ride, then the one that comes, both through the cabin.
    """
    joined = list(parts[0])
    for part in parts[1:]:
        joined += _ride(joined, part)
        joined += _continued(joined, part)
    return joined


def on_floor(arrivals: Sequence[Arrival], floor: int) -> list[Arrival]:
    """The arrivals with access points of this floor's own."""
    return [
        replace(a, measurement=replace(m, bssids=tuple(f"{floor:02x}{bssid[2:]}" for bssid in m.bssids)))
        if isinstance(m := a.measurement, WifiScan)
        else a
        for a in arrivals
    ]


def _newest(arrivals: Sequence[Arrival], kind: type) -> Arrival:
    return next(a for a in reversed(arrivals) if isinstance(a.measurement, kind))


def _ride(before: Sequence[Arrival], after: Sequence[Arrival]) -> list[Arrival]:
    """The measurements of a robot that stands in a cabin for `RIDE_S`."""
    start_ns = before[-1].at_ns
    odometry, scan = _newest(before, Odometry), _newest(before, LaserScan)
    heard = _by_receiver(before[::-1]), _by_receiver(after)
    ride = []
    for tenth in range(1, 10 * RIDE_S):
        at_ns = start_ns + tenth * SECOND_NS // 10
        moments = [replace(odometry.measurement, stamp_ns=at_ns), _cabin(scan, at_ns)]
        if tenth % 10 == 5:
            scans = heard[tenth >= 5 * RIDE_S]
            m = scans[tenth // 10 % len(scans)]
            rssi = (m.rssi - ATTENUATED_DB).astype(np.float32)
            moments.append(replace(m, stamp_ns=at_ns, rssi=rssi, age_s=np.zeros_like(m.age_s)))
        ride += [Arrival(at_ns, m) for m in moments]
    return ride


def _by_receiver(arrivals: Sequence[Arrival]) -> list[WifiScan]:
    """The first scan of each receiver."""
    first: dict[str, WifiScan] = {}
    for a in arrivals:
        if isinstance(a.measurement, WifiScan):
            first.setdefault(a.measurement.receiver, a.measurement)
    return [first[receiver] for receiver in sorted(first)]


def _cabin(scan: Arrival, at_ns: int) -> LaserScan:
    """A sweep in the middle of a square cabin."""
    m = scan.measurement
    assert isinstance(m, LaserScan)
    bearings = m.angle_min + np.arange(len(m.ranges)) * m.angle_increment
    ranges = 0.5 * CABIN_M / np.maximum(np.abs(np.cos(bearings)), np.abs(np.sin(bearings)))
    return replace(m, stamp_ns=at_ns, ranges=ranges.astype(np.float32))


def _continued(before: Sequence[Arrival], after: Sequence[Arrival]) -> list[Arrival]:
    """The arrivals after a ride, later, and with the odometry going on."""
    shift_ns = before[-1].at_ns + SECOND_NS // 10 - after[0].at_ns
    first = next(a.measurement for a in after if isinstance(a.measurement, Odometry))
    last = _newest(before, Odometry).measurement
    assert isinstance(last, Odometry)
    T = last.pose @ first.pose.inverse()
    return [
        Arrival(a.at_ns + shift_ns, _moved(a.measurement, T, shift_ns))
        for a in after
        if not isinstance(a.measurement, StaticTransforms)
    ]


def _moved(m: object, T: Pose2, shift_ns: int) -> object:
    if isinstance(m, Odometry):
        m = replace(m, pose=T @ m.pose)
    return replace(m, stamp_ns=m.stamp_ns + shift_ns)
