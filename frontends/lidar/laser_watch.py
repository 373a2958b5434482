"""A watch over the laser: what is wrong with its scans is told once when it begins, once when it ends.

A complaint rests on the last scans taken together: some drivers cut a sweep into several scans, most of them empty.
"""

from collections.abc import Generator, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wayfi.frontends.complaints import Complaints, Fault
from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.measurements import SECOND_NS, LaserScan, PointCloud, Sensor

BLOCKED, FEW_RETURNS, LATE = "blocked", "few_returns", "late"
NAME = "laser"

COVER_M = 0.15  # nearer is something on the sensor
BLOCKED_SHARE = 0.8  # of all beams; a fifth was seen to end at a robot's own parts
FEW_SHARE = 0.2  # of all beams; sound lasers in bare corridors were seen to have 0.38 return
LATE_NS = 1_500_000_000  # after the odometry of the same stamp
FAULTY, WINDOW = 16, 20  # so many faulty ones among the last so many scans are a complaint
SILENT_S = 30  # sound recordings have scans 14 s apart

LIMIT_SHARE = 0.998  # of range_max: drivers say a little less where nothing returns
CEILING_SHARE = 0.05  # of all beams at the scan's largest range; walls were seen to give 0.022
CEILING_SCANS = 5

Sweep = LaserScan | PointCloud

TEXTS = {
    BLOCKED: "something covers it; such scans are not used",
    FEW_RETURNS: "few of its beams return (glass, dirt, or a place wider than its range)",
    LATE: f"its scans are {LATE_NS / SECOND_NS} s and more behind the odometry: they come late, or its clock is slow",
}
RULES = {
    BLOCKED: Fault(FAULTY, WINDOW, "it sees again"),
    FEW_RETURNS: Fault(FAULTY, WINDOW, "its beams return again"),
    LATE: Fault(FAULTY, WINDOW, "its scans come in time again"),
}


class LaserWatch:
    """Watches the laser that is used, in bounded memory."""

    def __init__(self) -> None:
        self._complaints = Complaints("{}", RULES, SILENT_S)
        self._ceiling = Ceiling()

    def add(self, stamp_ns: int, sweep: Sweep, late_ns: int) -> Generator[Event, None, Sweep | None]:
        """A sweep has come, `late_ns` after the odometry of its stamp; returns what is to be used of it, if anything.

        Of a cloud only the time is watched.
        """
        self._complaints.heard(NAME)
        yield from self._judge(stamp_ns, LATE, late_ns > LATE_NS)
        return sweep if isinstance(sweep, PointCloud) else (yield from self._look(stamp_ns, sweep))

    def _look(self, stamp_ns: int, scan: LaserScan) -> Generator[Event, None, LaserScan | None]:
        blocked = near_share(scan) >= BLOCKED_SHARE
        yield from self._judge(stamp_ns, BLOCKED, blocked)
        if blocked:
            yield from self._judge(stamp_ns, FEW_RETURNS, False)
            yield Dropped(Sensor.SCAN, stamp_ns, DropReason.NO_RETURN)
            return None
        scan = self._ceiling.clear(scan)
        if self._ceiling.noticed:
            yield Warned(stamp_ns, f"laser: {self._ceiling.top_m:g} m is what it reports where nothing returns")
        yield from self._judge(stamp_ns, FEW_RETURNS, return_share(scan) < FEW_SHARE)
        return scan

    def pass_time(self, stamp_ns: int) -> Iterator[Event]:
        """Complain if the laser has sent nothing for long when the odometry has come to `stamp_ns`."""
        return self._complaints.pass_time(stamp_ns)

    def _judge(self, stamp_ns: int, fault: str, faulty: bool) -> Iterator[Event]:
        yield from self._complaints.judge(stamp_ns, NAME, fault, [faulty], TEXTS[fault])


class Ceiling:
    """Drivers that report one large range where nothing returns: many beams end at the scan's largest range exactly.

    The range is remembered until a scan sees further, since not every scan has many such beams. Beams at the sensor's
    own limit, or just under it, do not return either.
    """

    def __init__(self) -> None:
        self.top_m = np.inf
        self._scans = 0
        self.noticed = False

    def clear(self, scan: LaserScan) -> LaserScan:
        """The scan with inf for the beams that end there; `noticed` once it is sure, of a range that scans may have."""
        limit_m = LIMIT_SHARE * scan.range_max_m if scan.range_max_m > 0 else np.inf
        finite = scan.ranges[np.isfinite(scan.ranges)]
        self.noticed = False
        if len(finite) and finite.max() < limit_m:
            self._learn(finite, len(scan.ranges))
            limit_m = self.top_m
        beyond: NDArray[np.bool_] = scan.ranges >= limit_m
        return replace(scan, ranges=np.where(beyond, np.float32(np.inf), scan.ranges)) if beyond.any() else scan

    def _learn(self, finite: NDArray[np.float32], beams: int) -> None:
        top_m = float(finite.max())
        if int((finite == top_m).sum()) < CEILING_SHARE * beams:
            if top_m > self.top_m:
                self.top_m, self._scans = np.inf, 0
            return
        self._scans = self._scans + 1 if top_m == self.top_m else 1
        self.top_m = top_m
        self.noticed = self._scans == CEILING_SCANS


def near_share(scan: LaserScan) -> float:
    """The share of a scan's beams that end on the sensor's cover."""
    return _share((scan.ranges > 0) & (scan.ranges < max(scan.range_min_m, COVER_M)))


def return_share(scan: LaserScan) -> float:
    """The share of a scan's beams that return."""
    top_m = scan.range_max_m if scan.range_max_m > 0 else np.inf
    return _share((scan.ranges >= scan.range_min_m) & (scan.ranges > 0) & (scan.ranges < top_m))


def _share(beams: NDArray[np.bool_]) -> float:
    return float(np.count_nonzero(beams)) / max(len(beams), 1)
