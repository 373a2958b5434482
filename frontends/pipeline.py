"""The stream: process(measurement) -> [events]. A pure function of what it is fed; it reads no clock."""

from collections.abc import Generator, Iterator
from contextlib import nullcontext
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.factors import Factor
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import Dropped, DropReason, Event, GridRedrawn, PosePublished, Warned
from wayfi.frontends.intake.laser_lead import LaserLead
from wayfi.frontends.intake.scan_intake import ScanIntake, sees_anything, sensor_of
from wayfi.frontends.intake.wifi_intake import WifiIntake
from wayfi.frontends.lidar.laser_watch import LaserWatch
from wayfi.frontends.measurements import (
    SECOND_NS,
    LaserScan,
    Measurement,
    Odometry,
    PointCloud,
    Sensor,
    StaticTransforms,
    Sweep,
    WifiScan,
)
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint, calibration_prior, fault_of, keyframe_due
from wayfi.frontends.odometry.live_pose import Estimate
from wayfi.frontends.odometry.timebase import TimeBase
from wayfi.frontends.odometry.trajectories import Trajectories
from wayfi.frontends.slam import Slam, Timer
from wayfi.frontends.slam_config import SlamConfig
from wayfi.frontends.wifi.readings_by_place import PlacedReadings
from wayfi.frontends.wifi.wifi import Fingerprint

ODOMETRY_WAIT_NS = 2_000_000_000  # of scans without odometry, after which the laser leads
TELL_EVERY = 50  # messages of odometry, of a robot that stands still
MOST_UNMOUNTED = 32  # frames that are told of


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """The drive as believed at the end: stamps (n,), trajectories (n, 3), keyframes (k, 3), fingerprints (m, 3)."""

    stamps_ns: NDArray[np.int64]
    final: Floats
    online: Floats
    keyframe_poses: Floats
    factors: dict[int, Factor]
    calibration: Calibration
    grid: OccupancyGrid
    fingerprints: list[Fingerprint]
    fingerprint_poses: Floats


class Pipeline:
    """One drive. Feed it measurements in the order they came; every one is used, or dropped with its reason."""

    def __init__(self, config: SlamConfig, calibration: Calibration | None = None, timer: Timer | None = None) -> None:
        self._config = config
        self._timer: Timer = timer or (lambda _: nullcontext())
        self._time = TimeBase()
        self._path = DrivenPath(config.odometry)
        self._slam = Slam(config, calibration or Calibration(calibration_prior(config.odometry), {}), self._timer)
        self._scans = ScanIntake(config.lidar)
        self._wifi = WifiIntake()
        self._trajectories = Trajectories()
        self._laser_leads: LaserLead | None = None
        self._laser: Sensor | None = None
        self._last_scan_path_m = -np.inf
        self._unmounted: set[str] = set()
        self._laser_watch = LaserWatch(config.lidar.watch)
        self._laser_shift_ns = 0
        self._odometry_taken = 0
        self._told = (0, 0)

    def process(self, measurement: Measurement, published: PosePublished | None = None) -> list[Event]:
        """Take one measurement; returns what became known by it, in order.

        `published` is the pose that was published for it already, on an earlier estimate.
        """
        match measurement:
            case Odometry():
                return list(self._odometry(measurement, published))
            case LaserScan() | PointCloud():
                return list(self._scan(measurement))
            case WifiScan():
                return list(self._wifi_scan(measurement))
            case StaticTransforms():
                refused = self._scans.take_transforms(measurement)
                return [Dropped(Sensor.TF_STATIC, measurement.stamp_ns, reason) for reason in refused]

    def finish(self) -> tuple[Result, list[Event]]:
        """End the drive: what still waits is used or dropped, and the grid is drawn."""
        events = list(self._use_last_scans(self._scans.waiting()))
        events += self._use_wifi(self._wifi.finish())
        slam = self._slam
        if len(slam.keyframes):
            events += slam.settle(slam.keyframes[len(slam.keyframes) - 1].point.stamp_ns)
        with self._timer("map"):
            grid = slam.grid.settle(slam.poses)
        stamp_ns = int(self._trajectories.stamps_ns()[-1]) if len(self._trajectories) else 0
        events.append(GridRedrawn(stamp_ns, grid.probability(), grid.resolution_m, grid.origin_xy_m))
        points = [slam.keyframes[k].point for k in range(len(slam.keyframes))]
        calibration = Calibration(slam.graph.calibration(), slam.wifi.receivers.offsets)
        final = self._trajectories.final(points, slam.poses, calibration.wheels.values) if points else np.zeros((0, 3))
        result = Result(
            self._trajectories.stamps_ns(), final, self._trajectories.online(), slam.poses.copy(),
            slam.graph.factors(), calibration, grid, slam.wifi.fingerprints, slam.fingerprint_poses(),
        )  # fmt: skip
        return result, events

    def estimate(self, serial: int) -> Estimate:
        """What a live pose needs to go on from here."""
        anchor = self._slam.anchor() if len(self._slam.keyframes) and not self._laser_leads else None
        return Estimate(serial, self._odometry_taken, deepcopy(self._time), self._path.tip(), anchor)

    def new_estimate(self, serial: int) -> Estimate | None:
        """The estimate, where there is a new keyframe or some odometry since the last that this returned."""
        keyframes, odometry = self._told
        if len(self._slam.keyframes) == keyframes and self._odometry_taken < odometry + TELL_EVERY:
            return None
        self._told = len(self._slam.keyframes), self._odometry_taken
        return self.estimate(serial)

    def history(self) -> list[Event]:
        """What a picture that begins now has to show first: every keyframe where it is believed to be, and the grid."""
        events = self._slam.history()
        if len(self._slam.keyframes):
            grid = deepcopy(self._slam.grid).redraw(self._slam.poses)
            events.append(GridRedrawn(self._stamp_ns, grid.probability(), grid.resolution_m, grid.origin_xy_m))
        return events

    @property
    def _stamp_ns(self) -> int:
        return self._path.latest.stamp_ns if self._path.latest else 0

    def go_on(self, seconds: float) -> list[Event]:
        """Whoever feeds this was away for so long; a new estimate is due."""
        self._told = (-1, 0)
        self._path.go_on()
        text = f"away for {seconds:.1f} s: what was driven meanwhile is what the odometry says of it"
        return [Warned(self._stamp_ns, text)]

    def _odometry(self, m: Odometry, published: PosePublished | None) -> Iterator[Event]:
        self._odometry_taken += 1
        if fault := fault_of(m.pose):
            yield Dropped(Sensor.ODOM, m.stamp_ns, fault)
            return
        stamp_ns = yield from self._stamp(Sensor.ODOM, m.stamp_ns)
        if stamp_ns is None:
            return
        if self._laser_leads:
            self._laser_leads = None
            self._path.restart()
            yield Warned(stamp_ns, "odometry has come: the wheels lead from here on, not the laser")
        latest = self._path.latest
        if latest is not None and stamp_ns <= latest.stamp_ns:
            yield Dropped(Sensor.ODOM, stamp_ns, DropReason.TOO_LATE)
            return
        for scan in self._scans.drop_ahead(stamp_ns + ODOMETRY_WAIT_NS):
            yield Dropped(sensor_of(scan), scan.stamp_ns, DropReason.AHEAD)
        yield from self._laser_watch.check_silence(stamp_ns)
        yield from self._wifi.compare(stamp_ns)
        yield from self._advance(stamp_ns, m.pose, published)

    def _advance(self, stamp_ns: int, T_odom_base: Pose2, published: PosePublished | None = None) -> Iterator[Event]:
        """The robot has come to `T_odom_base`: use what waited for it, then publish where that is."""
        if not self._path.advance(stamp_ns, T_odom_base):
            yield Warned(stamp_ns, "the odometry leapt further than a robot drives; the leap counts as no motion")
        point = self._path.latest
        assert point is not None
        if len(self._slam.keyframes) == 0:
            yield from self._slam.add_keyframe(point, None)
        yield from self._use_scans()
        yield from self._keyframe_without_scan(point)
        yield from self._use_wifi(self._wifi.ready(self._path))
        yield self._publish(point, T_odom_base, published)
        yield from self._redraw_grid(stamp_ns)

    def _redraw_grid(self, stamp_ns: int) -> Iterator[Event]:
        if self._slam.grid.due:
            with self._timer("map"):
                grid = self._slam.grid.redraw(self._slam.poses)
            yield GridRedrawn(stamp_ns, grid.probability(), grid.resolution_m, grid.origin_xy_m)

    def _publish(self, point: PathPoint, T_odom_base: Pose2, published: PosePublished | None) -> PosePublished:
        if published is None or published.stamp_ns != point.stamp_ns:
            published = self._slam.anchor().pose_at(point, T_odom_base, self._config.odometry)
        self._trajectories.add(point, published.T_map_base)
        return published

    def _keyframe_without_scan(self, point: PathPoint) -> Iterator[Event]:
        silent = point.path_m - self._last_scan_path_m >= self._config.lidar.silent_m
        if silent and keyframe_due(self._slam.motion_to(point), self._config.odometry):
            yield from self._slam.add_keyframe(point, None)

    def _scan(self, m: Sweep) -> Iterator[Event]:
        sensor = sensor_of(m)
        if not self._config.lidar.enabled:
            yield Dropped(sensor, m.stamp_ns, DropReason.SENSOR_OFF)
            return
        stamp_ns = yield from self._stamp(sensor, m.stamp_ns)
        if stamp_ns is None:
            return
        if sensor is not (self._laser or sensor):
            yield Dropped(sensor, stamp_ns, DropReason.OTHER_LASER)
            return
        stamp_ns += self._laser_shift_ns
        latest = self._path.latest
        sweep = yield from self._laser_watch.add_sweep(stamp_ns, m, latest.stamp_ns - stamp_ns if latest else 0)
        if sweep is None:
            return
        if not sees_anything(sweep, self._config.lidar.max_range_m):
            yield Dropped(sensor, stamp_ns, DropReason.NO_RETURN)
            return
        self._laser = sensor
        for late in self._scans.wait(stamp_ns, sweep):
            yield Dropped(sensor_of(late), late.stamp_ns, DropReason.TOO_MANY_WAIT)
        yield from self._use_scans()
        if self._laser_leads or self._scans.waited_ns > ODOMETRY_WAIT_NS:
            yield from self._lead_by_laser(stamp_ns)

    def _lead_by_laser(self, stamp_ns: int) -> Iterator[Event]:
        """Where no odometry comes, scan matching from scan to scan takes its place."""
        if self._laser_leads is None:
            self._laser_leads = LaserLead(self._config.lidar, self._scans)
            self._path.restart()
            yield Warned(stamp_ns, "no odometry: the laser leads")
        yield from self._wifi.compare(stamp_ns)
        for scan_ns, scan in self._scans.waiting():
            latest = self._path.latest
            if latest is not None and scan_ns <= latest.stamp_ns:
                continue
            yield from self._advance(scan_ns, self._laser_leads.register(scan_ns, scan))

    def _use_last_scans(self, waiting: list[tuple[int, Sweep]]) -> Iterator[Event]:
        """At the end: the laser leads as far as it did, or where odometry never came; else they came after it."""
        if waiting and (self._laser_leads or self._path.latest is None):
            yield from self._lead_by_laser(waiting[-1][0])
        else:
            yield from (Dropped(sensor_of(scan), scan_ns, DropReason.AHEAD) for scan_ns, scan in waiting)

    def _use_scans(self) -> Iterator[Event]:
        for point, scan in self._scans.ready(self._path):
            if point is None:
                yield Dropped(sensor_of(scan), scan.stamp_ns, DropReason.TOO_LATE)
                continue
            first = self._last_scan_path_m == -np.inf
            self._last_scan_path_m = point.path_m
            motion = self._slam.motion_to(point)
            due = keyframe_due(motion, self._config.odometry, self._slam.keyframe_stretch())
            if motion.seconds <= 0 or not (first or due):
                continue
            yield from self._warn_unmounted(scan)
            with self._timer("scan_points"):
                placed = self._scans.place(point, scan, self._path)
            yield from self._slam.add_keyframe(point, placed)
            yield from self._correct_stamps(point.stamp_ns)

    def _correct_stamps(self, stamp_ns: int) -> Iterator[Event]:
        """Where the laser has another clock than the odometry, correct its stamps and forget what it said till then."""
        offset_s = self._slam.laser_clock.offset_s(self._path)
        if offset_s is None:
            return
        self._laser_shift_ns += round(offset_s * SECOND_NS)
        text = f"its clock is {abs(offset_s):.2f} s {'behind' if offset_s > 0 else 'ahead of'} the odometry's"
        yield Warned(stamp_ns, f"laser: {text}; its stamps are corrected from here on, set its clock", "laser.clock")
        yield from self._slam.forget_scans(f"of before the laser's stamps were corrected: {text}")

    def _warn_unmounted(self, scan: Sweep) -> Iterator[Event]:
        told = scan.frame_id in self._unmounted or len(self._unmounted) >= MOST_UNMOUNTED
        if not told and not self._scans.knows(scan.frame_id):
            self._unmounted.add(scan.frame_id)
            text = f"no /tf_static says where {scan.frame_id!r} is mounted; taken to be at base_link (see lidar.mount)"
            yield Warned(scan.stamp_ns, text)

    def _wifi_scan(self, m: WifiScan) -> Iterator[Event]:
        if not self._config.wifi.enabled:
            yield Dropped(Sensor.WIFI, m.stamp_ns, DropReason.SENSOR_OFF)
            return
        yield from self._wifi.take(m, self._time.offset_ns, self._path.latest)
        yield from self._use_wifi(self._wifi.ready(self._path))

    def _use_wifi(self, ready: Iterator[PlacedReadings | Event]) -> Iterator[Event]:
        for heard in ready:
            latest = self._path.latest
            if isinstance(heard, PlacedReadings) and latest is not None:
                yield from self._slam.add_wifi(latest.stamp_ns, heard.receiver, heard.point, heard.readings)
            elif not isinstance(heard, PlacedReadings):
                yield heard

    def _stamp(self, sensor: Sensor, stamp_ns: int) -> Generator[Event, None, int | None]:
        """The stamp on the time base as the generator's return value; None if the message is dropped."""
        stamped = self._time.accept(sensor, stamp_ns)
        if stamped.shift_ns:
            where = "back" if stamped.shift_ns > 0 else "forward again"
            text = f"the clock was set {where}: stamps are shifted by {self._time.offset_ns * 1e-9:+.3f} s from here on"
            yield Warned(stamped.stamp_ns, text)
        if stamped.dropped:
            yield Dropped(sensor, stamped.stamp_ns, stamped.dropped)
            return None
        return stamped.stamp_ns
