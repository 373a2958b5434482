"""Watches the laser for faults: blocked, few returns, late, silent. Each is reported when it begins and when it ends.

A complaint rests on the last scans taken together: some drivers cut a sweep into several scans, most of them empty.
"""

from collections.abc import Generator, Iterator
from dataclasses import replace

import numpy as np

from wayfi.frontends.complaints import Complaints, Fault
from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.lidar.beam_counts import beams_between, largest_range
from wayfi.frontends.lidar.lidar_config import LaserWatchConfig
from wayfi.frontends.measurements import SECOND_NS, LaserScan, PointCloud, Sensor, Sweep

BLOCKED, FEW_RETURNS, LATE = "blocked", "few_returns", "late"
NAME = "laser"
ENDS = {
    BLOCKED: "it sees again",
    FEW_RETURNS: "its beams return again",
    LATE: "its scans come in time again",
}


def complaint_texts(config: LaserWatchConfig) -> dict[str, str]:
    """The text of each fault's complaint."""
    return {
        BLOCKED: "something covers it; such scans are not used",
        FEW_RETURNS: "few of its beams return (glass, dirt, or a place wider than its range)",
        LATE: f"its scans are {config.late_s:g} s and more behind the odometry: they come late, or its clock is slow",
    }


class LaserWatch:
    """Watches a laser, whose `name` begins every complaint, in bounded memory."""

    def __init__(self, config: LaserWatchConfig, name: str = NAME) -> None:
        self._config, self._name = config, name
        self._texts = complaint_texts(config)
        faults = {fault: Fault(config.faulty, config.window, ends) for fault, ends in ENDS.items()}
        self._complaints = Complaints("{}", faults, config.silent_s)
        self._no_return = NoReturnRange(config)

    def add_sweep(self, stamp_ns: int, sweep: Sweep, late_ns: int) -> Generator[Event, None, Sweep | None]:
        """Check a sweep that came `late_ns` after the odometry of its stamp.

        Returns the sweep as it may be used: None if the laser is blocked, inf for beams that did not return. A cloud
        is checked for lateness alone.
        """
        self._complaints.heard(self._name)
        yield from self._count_fault(stamp_ns, LATE, late_ns > round(self._config.late_s * SECOND_NS))
        return sweep if isinstance(sweep, PointCloud) else (yield from self._check_ranges(stamp_ns, sweep))

    def _check_ranges(self, stamp_ns: int, scan: LaserScan) -> Generator[Event, None, LaserScan | None]:
        blocked = covered_share(scan, self._config.cover_m) >= self._config.blocked_share
        yield from self._count_fault(stamp_ns, BLOCKED, blocked)
        if blocked:
            yield from self._count_fault(stamp_ns, FEW_RETURNS, False)
            yield Dropped(Sensor.SCAN, stamp_ns, DropReason.NO_RETURN, scan.topic)
            return None
        scan = self._no_return.mark(scan)
        if self._no_return.confirmed:
            yield Warned(
                stamp_ns, f"{self._name}: {self._no_return.range_m:g} m is what it reports where nothing returns"
            )
        yield from self._count_fault(stamp_ns, FEW_RETURNS, return_share(scan) < self._config.min_return_share)
        return scan

    def check_silence(self, stamp_ns: int) -> Iterator[Event]:
        """Count the laser's silence up to `stamp_ns`, the newest odometry's."""
        return self._complaints.pass_time(stamp_ns)

    def _count_fault(self, stamp_ns: int, fault: str, faulty: bool) -> Iterator[Event]:
        """Note whether the newest scan has a fault; it is a complaint while enough of the last scans have it."""
        yield from self._complaints.judge(stamp_ns, self._name, fault, [faulty], self._texts[fault])


class NoReturnRange:
    """Finds the range that a driver reports where nothing returns: many beams have the scan's largest range exactly.

    It is kept until a scan has a larger range, since not every scan has many such beams. Beams at the sensor's own
    limit, or just under it, count as no return as well. `range_m` is inf while none is found; `confirmed` is True for
    the scan that confirms it.
    """

    def __init__(self, config: LaserWatchConfig) -> None:
        self._config = config
        self._scans = 0
        self.range_m = np.inf
        self.confirmed = False

    def mark(self, scan: LaserScan) -> LaserScan:
        """The scan with inf for the beams that did not return."""
        limit_m = np.inf
        if scan.range_max_m > 0:
            limit_m = float(np.float32(self._config.limit_share * scan.range_max_m))  # as precise as ranges are
        largest_m, have_it = largest_range(scan.ranges)
        self.confirmed = False
        if have_it and largest_m < limit_m:
            self._update(largest_m, have_it, len(scan.ranges))
            limit_m = self.range_m
        if largest_m < limit_m:
            return scan
        return replace(scan, ranges=np.where(scan.ranges >= limit_m, np.float32(np.inf), scan.ranges))

    def _update(self, largest_m: float, have_it: int, beams: int) -> None:
        if have_it < self._config.no_return_share * beams:
            if largest_m > self.range_m:
                self.range_m, self._scans = np.inf, 0
            return
        self._scans = self._scans + 1 if largest_m == self.range_m else 1
        self.range_m = largest_m
        self.confirmed = self._scans == self._config.no_return_scans


def covered_share(scan: LaserScan, cover_m: float) -> float:
    """The share of a scan's beams that end nearer than `cover_m`, or than the sensor's least range."""
    return beams_between(scan.ranges, 0.0, max(scan.range_min_m, cover_m)) / max(len(scan.ranges), 1)


def return_share(scan: LaserScan) -> float:
    """The share of a scan's beams that return."""
    max_m = scan.range_max_m if scan.range_max_m > 0 else np.inf
    too_near = beams_between(scan.ranges, 0.0, scan.range_min_m)
    return (beams_between(scan.ranges, 0.0, max_m) - too_near) / max(len(scan.ranges), 1)
