"""WiFi scans on their way to a fingerprint: watched, kept until the odometry comes, their readings put in place."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.events import Dropped, DropReason, Event
from wayfi.frontends.measurements import SECOND_NS, Sensor, WifiScan
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.wifi.fingerprints import Readings, usable_readings
from wayfi.frontends.wifi.readings_by_place import PlacedReadings, ReadingsByPlace
from wayfi.frontends.wifi.wifi_watch import WifiWatch

EARLY_NS = 5 * SECOND_NS  # before the first pose, a scan waits so long for it
WAIT_NS = 30 * SECOND_NS  # later, for the odometry to go on
MOST_RECEIVERS = 32  # a robot was seen to carry three; every one that was ever heard is remembered
MOST_WAITING = 500  # scans: thirty seconds of three phones, channel by channel


@dataclass(frozen=True, slots=True, eq=False)
class _Scan:
    stamp_ns: int
    receiver: str
    readings: Readings


class WifiIntake:
    """Knows which receivers can be believed and which scans still wait."""

    def __init__(self) -> None:
        self._watch = WifiWatch()
        self._by_place = ReadingsByPlace()
        self._last_ns: dict[str, int] = {}
        self._not_compared: list[_Scan] = []
        self._waiting: list[_Scan] = []
        self._first: PathPoint | None = None

    def take(self, m: WifiScan, offset_ns: int, latest: PathPoint | None) -> Iterator[Event]:
        """Take in a scan; `offset_ns` leads to the time base, `latest` is where the odometry has come to."""
        stamp_ns = m.stamp_ns + offset_ns
        if m.receiver not in self._last_ns and len(self._last_ns) >= MOST_RECEIVERS:
            yield Dropped(Sensor.WIFI, stamp_ns, DropReason.TOO_MANY_RECEIVERS)
            return
        if disorder := self._disorder(m.receiver, stamp_ns):
            yield Dropped(Sensor.WIFI, stamp_ns, disorder)
            return
        if not (yield from self._watch.count(stamp_ns, m.receiver, len(m.bssids))):
            return
        usable = usable_readings(m)
        yield from (Dropped(Sensor.WIFI, stamp_ns, reason) for reason in usable.dropped)
        if not usable.bssids:
            yield Dropped(Sensor.WIFI, stamp_ns, DropReason.NO_READINGS)
            return
        scan = _Scan(stamp_ns, m.receiver, usable)
        if latest and stamp_ns <= latest.stamp_ns:
            yield from self._compare(scan, stamp_ns - latest.stamp_ns)
        else:
            yield from self._wait_for_odometry(scan)

    def compare(self, odometry_ns: int) -> Iterator[Event]:
        """The odometry has come to `odometry_ns`; what came in since its last message is compared with that."""
        yield from self._watch.pass_time(odometry_ns)
        came_since, self._not_compared = self._not_compared, []
        for scan in came_since:
            yield from self._compare(scan, max(0, scan.stamp_ns - odometry_ns))

    def ready(self, path: DrivenPath) -> Iterator[PlacedReadings | Event]:
        """What was heard at places that the odometry has passed; and what is dropped."""
        latest = path.latest
        if latest is None:
            return
        self._first = self._first or latest
        covered = [scan for scan in self._waiting if scan.stamp_ns <= latest.stamp_ns]
        self._waiting = [scan for scan in self._waiting if scan.stamp_ns > latest.stamp_ns]
        for scan in covered:
            yield from self._put_in_place(scan, path)
        yield from self._by_place.ready(latest.stamp_ns)

    def finish(self) -> Iterator[PlacedReadings | Event]:
        """The end: what still waits for later readings does without; what waits for the odometry has no place."""
        yield from self._by_place.ready(np.iinfo(np.int64).max)
        for scan in self._waiting + self._not_compared:
            yield Dropped(Sensor.WIFI, scan.stamp_ns, DropReason.NO_POSE)

    def _disorder(self, receiver: str, stamp_ns: int) -> DropReason | None:
        """Against the scan just before alone: where a phone's clock was set back, the odometry's tells the rest."""
        last_ns = self._last_ns.get(receiver)
        self._last_ns[receiver] = stamp_ns
        if last_ns is None or stamp_ns > last_ns:
            return None
        return DropReason.DUPLICATE if stamp_ns == last_ns else DropReason.STAMP_BACK

    def _compare(self, scan: _Scan, ahead_ns: int) -> Iterator[Event]:
        if (yield from self._watch.compare_clocks(scan.stamp_ns, scan.receiver, ahead_ns)):
            self._waiting.append(scan)

    def _wait_for_odometry(self, scan: _Scan) -> Iterator[Event]:
        """No longer than allowed, by the clock of its receiver."""
        oldest_ns = scan.stamp_ns - (WAIT_NS if self._first else EARLY_NS)
        late = [s for s in self._not_compared if s.receiver == scan.receiver and s.stamp_ns < oldest_ns]
        yield from (Dropped(Sensor.WIFI, s.stamp_ns, DropReason.NO_POSE) for s in late)
        gone = {id(s) for s in late}
        self._not_compared = [s for s in self._not_compared if id(s) not in gone] + [scan]
        if len(self._not_compared) > MOST_WAITING:
            yield Dropped(Sensor.WIFI, self._not_compared.pop(0).stamp_ns, DropReason.TOO_MANY_WAIT)

    def _put_in_place(self, scan: _Scan, path: DrivenPath) -> Iterator[Event]:
        point, taken_m = self._at(scan.stamp_ns, path), self._taken_m(scan, path)
        unplaced = int(np.isnan(taken_m).sum())
        if point is None:
            yield Dropped(Sensor.WIFI, scan.stamp_ns, DropReason.TOO_LATE)
            return
        yield from [Dropped(Sensor.WIFI, scan.stamp_ns, DropReason.TOO_LATE)] * unplaced
        if (yield from self._watch.hear(scan.stamp_ns, scan.receiver, scan.readings, taken_m)):
            self._by_place.add(scan.receiver, point, scan.readings, taken_m)

    def _taken_m(self, scan: _Scan, path: DrivenPath) -> Floats:
        """(n,) where on the path each reading was taken, NaN where that is no longer kept."""
        age_s, back = np.unique(scan.readings.age_s, return_inverse=True)
        points = [self._at(scan.stamp_ns - int(float(age) * SECOND_NS), path) for age in age_s]
        taken_m: Floats = np.array([point.path_m if point else np.nan for point in points])[back]
        return taken_m

    def _at(self, taken_ns: int, path: DrivenPath) -> PathPoint | None:
        """The path at a moment; what was taken shortly before the first pose was taken there."""
        first = self._first
        if first and taken_ns < first.stamp_ns <= taken_ns + EARLY_NS:
            return first
        return path.at(taken_ns)
