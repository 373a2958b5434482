"""The lasers of a robot, told apart by topic and frame: what each sends is made usable, or told to be wrong."""

from collections import OrderedDict
from collections.abc import Generator, Iterator

from wayfi.frontends.complaints import Complaints, Fault
from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.frames.frame_tree import frame_name
from wayfi.frontends.lasers.bearings import BearingsCheck
from wayfi.frontends.lasers.fragments import Fragments
from wayfi.frontends.lasers.range_limits import RangeUnit, with_limits
from wayfi.frontends.lasers.sweep_time import SweepTime
from wayfi.frontends.lidar.laser_watch import LaserWatch
from wayfi.frontends.lidar.lidar_config import LaserWatchConfig
from wayfi.frontends.measurements import LaserScan, PointCloud, Sensor, Sweep

MOST_LASERS = 8  # that are remembered, to bound memory; robots carry one to four
LIMITS, UNIT, BEARINGS, SWEEP = "range_limits", "range_unit", "bearings", "time_increment"
FAULTS = {
    LIMITS: Fault(3, 5, "its range limits can be used again"),
    UNIT: Fault(3, 5, "its ranges are in metres again"),
    BEARINGS: Fault(3, 5, "the bearings of its beams agree again"),
    SWEEP: Fault(3, 5, "its sweeps are no longer than the time between them again"),
}


class Laser:
    """One laser: `name` is used in warnings, `stream` names its clock, and `watch` looks for faults of its sweeps."""

    def __init__(self, name: str, stream: str, config: LaserWatchConfig, first: bool) -> None:
        self.name, self.stream = name, stream
        self.watch = LaserWatch(config, "laser" if first else name)
        self._complaints = Complaints("{}", FAULTS, config.silent_s)
        self._complaints.heard(name)
        self._bearings, self._unit = BearingsCheck(), RangeUnit()
        self._sweep_time, self._fragments = SweepTime(), Fragments()
        self._was_sound = self._joins = False

    def receive(self, now_ns: int, scan: LaserScan) -> Generator[Event, None, list[LaserScan]]:
        """Check a scan as it was sent, at `now_ns` of the odometry; returns the whole scans that it completes."""
        scan, fault = with_limits(scan)
        yield from self._complain(now_ns, LIMITS, fault)
        metric, unit_fault = self._unit.check(scan)
        wrong_unit = yield from self._complain(now_ns, UNIT, unit_fault)
        seen, bearings_fault = self._bearings.check(metric)
        wrong_bearings = yield from self._complain(now_ns, BEARINGS, bearings_fault)
        lone = (unit_fault and not wrong_unit) or (bearings_fault and not wrong_bearings)
        self._was_sound |= not (unit_fault or bearings_fault or seen is None)
        if seen is None or (lone and self._was_sound):  # such a scan of a sound laser is a broken message
            yield Dropped(Sensor.SCAN, scan.stamp_ns, DropReason.IMPOSSIBLE_SCAN, scan.topic)
            return []
        timed, fault = self._sweep_time.check(seen)
        yield from self._complain(now_ns, SWEEP, fault)
        whole = self._fragments.add(timed)
        yield from self._tell_of_fragments(now_ns, timed)
        return whole

    def finish(self) -> list[LaserScan]:
        """At the end: the turn that is not complete."""
        return self._fragments.finish()

    def _complain(self, now_ns: int, fault: str, text: str) -> Generator[Event, None, bool]:
        return (yield from self._complaints.judge(now_ns, self.name, fault, [bool(text)], text))

    def _tell_of_fragments(self, now_ns: int, scan: LaserScan) -> Iterator[Event]:
        if self._fragments.joins and not self._joins:
            self._joins = True
            text = f"its scans are fragments of a turn, of {len(scan.ranges)} beams; those of a turn are joined to one"
            yield Warned(now_ns, f"{self.name}: {text}")


class Lasers:
    """The lasers that were heard of last, in bounded memory."""

    def __init__(self, config: LaserWatchConfig) -> None:
        self._config = config
        self._lasers: OrderedDict[tuple[Sensor, str, str], Laser] = OrderedDict()
        self._made = 0

    def __iter__(self) -> Iterator[Laser]:
        return iter(self._lasers.values())

    def of(self, sweep: Sweep) -> Laser:
        """The laser that a sweep is from; where there are too many, the one silent for longest is forgotten."""
        sensor, topic = (Sensor.POINTS, "") if isinstance(sweep, PointCloud) else (Sensor.SCAN, sweep.topic)
        key = sensor, topic, frame_name(sweep.frame_id)
        if key in self._lasers:
            self._lasers.move_to_end(key)
            return self._lasers[key]
        stream = f"{sensor} {self._made}" if self._made else str(sensor)
        if len(self._lasers) >= MOST_LASERS:
            stream = self._lasers.popitem(last=False)[1].stream
        name = f"laser {sweep.frame_id!r}{f' on {topic}' if topic else ''}"
        self._lasers[key] = Laser(name, stream, self._config, first=not self._made)
        self._made += 1
        return self._lasers[key]
