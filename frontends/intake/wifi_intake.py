"""WiFi scans before they become fingerprints: checked, held until the odometry covers them, placed on the path."""

from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.intake.sensor_clock import SensorClock
from wayfi.frontends.measurements import SECOND_NS, Sensor, WifiScan, content_of
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.odometry.odometry_config import ClockConfig
from wayfi.frontends.odometry.timebase import Stamped, TimeBase
from wayfi.frontends.wifi.readings import PlacedWifiScan, Readings, usable_readings
from wayfi.frontends.wifi.readings_by_place import ReadingsByPlace
from wayfi.frontends.wifi.wifi_config import WifiConfig
from wayfi.frontends.wifi.wifi_watch import WifiWatch

MOST_RECEIVERS = 32  # that are remembered, to bound memory; robots were seen to carry three
OLDEST_NS = 4e18  # an age beyond it, of a century, would not fit into an integer
MOST_WAITING = 500  # scans, to bound memory: 30 s of three phones that send every channel by itself


@dataclass(frozen=True, slots=True, eq=False)
class _Scan:
    """A scan that waits for the odometry to cover `stamp_ns`, which is on the time base.

    `compared`: its receiver's clock was compared with the odometry's.
    """

    stamp_ns: int
    receiver: str
    readings: Readings
    compared: bool = False


class WifiIntake:
    """Drops the scans of faulty receivers and holds the others until they have a place on the path."""

    def __init__(self, config: WifiConfig, clock: ClockConfig, odometry: TimeBase) -> None:
        self._early_ns, self._wait_ns = round(config.first_pose_s * SECOND_NS), round(config.odometry_s * SECOND_NS)
        self._watch = WifiWatch(config.watch)
        self._by_place = ReadingsByPlace(config.by_place)
        self._clock, self._odometry = clock, odometry
        self._clocks: dict[str, SensorClock] = {}
        self._waiting: list[_Scan] = []
        self._first: PathPoint | None = None

    def add(self, m: WifiScan, latest: PathPoint | None) -> Iterator[Event]:
        """Add the next scan; `latest` is the end of the driven path."""
        stamped = self._stamp(m)
        stamp_ns = stamped.stamp_ns
        if stamped.told:
            yield Warned(stamp_ns, f"WiFi receiver {m.receiver!r}: {stamped.told}")
        if stamped.dropped:
            yield Dropped(Sensor.WIFI, stamp_ns, stamped.dropped)
            return
        if not (yield from self._watch.count(stamp_ns, m.receiver, len(m.bssids))):
            return
        readings, dropped = usable_readings(m)
        yield from (Dropped(Sensor.WIFI, stamp_ns, reason) for reason in dropped)
        if not (yield from self._watch.check_readings(stamp_ns, m)):
            return
        if not readings.bssids:
            yield Dropped(Sensor.WIFI, stamp_ns, DropReason.NO_READINGS)
            return
        scan = _Scan(stamp_ns, m.receiver, readings)
        if latest and stamp_ns <= latest.stamp_ns:
            self._waiting += yield from self._compared(scan, stamp_ns - latest.stamp_ns)
        else:
            yield from self._wait_for_odometry(scan)

    def compare(self, odometry_ns: int) -> Iterator[Event]:
        """Compare the clocks of scans that came since the last odometry message with that of the newest one."""
        yield from self._watch.pass_time(odometry_ns)
        waiting: list[_Scan] = []
        for scan in self._waiting:
            ahead_ns = max(0, scan.stamp_ns - odometry_ns)
            waiting += [scan] if scan.compared else (yield from self._compared(scan, ahead_ns))
        self._waiting = waiting

    def ready(self, path: DrivenPath) -> Iterator[PlacedWifiScan | Event]:
        """Remove and return the scans that the path covers and that are due, each at its place; and what is dropped."""
        latest = path.latest
        if latest is None:
            return
        self._first = self._first or latest
        covered = [scan for scan in self._waiting if scan.compared and scan.stamp_ns <= latest.stamp_ns]
        self._waiting = [scan for scan in self._waiting if not scan.compared or scan.stamp_ns > latest.stamp_ns]
        for scan in covered:
            yield from self._place(scan, path)
        yield from self._by_place.ready(latest.stamp_ns)

    def finish(self) -> Iterator[PlacedWifiScan | Event]:
        """At the end: the scans that wait for later readings, without these; drops those ahead of the odometry."""
        yield from self._by_place.ready(np.iinfo(np.int64).max)
        for scan in self._waiting:
            yield Dropped(Sensor.WIFI, scan.stamp_ns, DropReason.NO_POSE)

    def _stamp(self, m: WifiScan) -> Stamped:
        """The stamp of a scan on the time base, or why it is dropped unread."""
        if m.receiver not in self._clocks:
            if len(self._clocks) >= MOST_RECEIVERS:
                return Stamped(m.stamp_ns, DropReason.TOO_MANY_RECEIVERS)
            self._clocks[m.receiver] = SensorClock(self._clock, self._odometry)
        return self._clocks[m.receiver].accept(m.stamp_ns, lambda: content_of(m))

    def _compared(self, scan: _Scan, ahead_ns: int) -> Generator[Event, None, list[_Scan]]:
        """The scan, compared, as the generator's return value; nothing where its clock is wrong."""
        right = yield from self._watch.compare_clocks(scan.stamp_ns, scan.receiver, ahead_ns)
        return [replace(scan, compared=True)] if right else []

    def _wait_for_odometry(self, scan: _Scan) -> Iterator[Event]:
        """Hold a scan until the next odometry; drops those of its receiver whose stamps are too long before its own."""
        oldest_ns = scan.stamp_ns - (self._wait_ns if self._first else self._early_ns)
        late = [s for s in self._uncompared() if s.receiver == scan.receiver and s.stamp_ns < oldest_ns]
        yield from (Dropped(Sensor.WIFI, s.stamp_ns, DropReason.NO_POSE) for s in late)
        self._forget(late)
        self._waiting.append(scan)
        uncompared = self._uncompared()
        if len(uncompared) > MOST_WAITING:
            self._forget(uncompared[:1])
            yield Dropped(Sensor.WIFI, uncompared[0].stamp_ns, DropReason.TOO_MANY_WAIT)

    def _uncompared(self) -> list[_Scan]:
        return [scan for scan in self._waiting if not scan.compared]

    def _forget(self, scans: list[_Scan]) -> None:
        gone = {id(scan) for scan in scans}
        self._waiting = [scan for scan in self._waiting if id(scan) not in gone]

    def _place(self, scan: _Scan, path: DrivenPath) -> Iterator[Event]:
        age_ns = int((self._by_place.common_age_s(scan.readings) or 0.0) * SECOND_NS)
        point, taken_m = self._at(scan.stamp_ns - age_ns, path), self._taken_m(scan, path)
        unplaced = int(np.isnan(taken_m).sum())
        if point is None:
            yield Dropped(Sensor.WIFI, scan.stamp_ns, DropReason.TOO_LATE)
            return
        yield from [Dropped(Sensor.WIFI, scan.stamp_ns, DropReason.TOO_LATE)] * unplaced
        if (yield from self._watch.compare_rssi(scan.stamp_ns, scan.receiver, scan.readings, taken_m)):
            self._by_place.add(PlacedWifiScan(scan.receiver, point, scan.readings, taken_m))

    def _taken_m(self, scan: _Scan, path: DrivenPath) -> Floats:
        """(n,) m along the path where each reading was taken, NaN where the path is no longer kept."""
        ages_ns = np.minimum(scan.readings.age_s.astype(np.float64) * SECOND_NS, OLDEST_NS).astype(np.int64)
        taken_ns = scan.stamp_ns - ages_ns
        first = self._first
        if first is not None:  # see _at
            early = (taken_ns < first.stamp_ns) & (first.stamp_ns <= taken_ns + self._early_ns)
            return np.where(early, first.path_m, path.lengths_at(taken_ns))
        return path.lengths_at(taken_ns)

    def _at(self, taken_ns: int, path: DrivenPath) -> PathPoint | None:
        """The path at a moment; a moment shortly before the first pose counts as that of the first pose."""
        first = self._first
        if first and taken_ns < first.stamp_ns <= taken_ns + self._early_ns:
            return first
        return path.at(taken_ns)
