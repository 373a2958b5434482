"""The stream: process(measurement) -> [events]. A pure function of what it is fed; it reads no clock."""

from collections.abc import Iterator

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import Dropped, DropReason, Event, PosePublished, Warned
from wayfi.frontends.intake.pose_intake import PlacedPose, PoseIntake
from wayfi.frontends.intake.scan_intake import ScanIntake, dropped
from wayfi.frontends.intake.stand_ins import StandIns
from wayfi.frontends.intake.sweep_sets import SweepSet
from wayfi.frontends.intake.wifi_intake import WifiIntake
from wayfi.frontends.keyframes import keyframe_due
from wayfi.frontends.lidar.doubt import stands
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.measurements import (
    SECOND_NS,
    LaserScan,
    Measurement,
    MovingTransforms,
    Odometry,
    PointCloud,
    Sensor,
    StaticTransforms,
    Sweep,
    WifiScan,
)
from wayfi.frontends.modes.estimation_core import estimation_core
from wayfi.frontends.odometry.accepted_odometry import Accepted, AcceptedOdometry
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.live_pose import Estimate, EstimateSchedule
from wayfi.frontends.odometry.pose_publisher import PosePublisher
from wayfi.frontends.odometry.timebase import told_of
from wayfi.frontends.result import DriveEstimate
from wayfi.frontends.scan_corrections import ScanCorrections
from wayfi.frontends.scan_points import PlacedScan
from wayfi.frontends.slam_config import SlamConfig
from wayfi.frontends.timer import Timer, untimed
from wayfi.frontends.wifi.readings import PlacedWifiScan


class Pipeline:
    """One drive. Feed it measurements in the order they came; every one is used, or dropped with its reason.

    It makes a map; or localises in `building` if that is given, or `extends` it.
    """

    def __init__(
        self,
        config: SlamConfig,
        calibration: Calibration | None = None,
        timer: Timer | None = None,
        building: BuildingMap | None = None,
        extends: bool = False,
    ) -> None:
        self._config = config
        self._timer: Timer = timer or untimed
        self._odometry = AcceptedOdometry(config.odometry)
        self._path = self._odometry.path
        self._core = estimation_core(config, calibration, self._timer, building, extends)
        self._lead_after_ns = round(config.odometry.laser_lead_s * SECOND_NS)
        self._scans = ScanIntake(config.lidar, config.odometry, self._odometry.time)
        self._stand_ins = StandIns(config.lidar, self._scans, self._odometry, self._lead_after_ns)
        self._wifi = WifiIntake(config.wifi, config.odometry.clock, self._odometry.time)
        self._poses = PoseIntake(config.frames, self._odometry.time)
        self._corrections = ScanCorrections(config.lidar, self._scans, self._core)
        self._publisher = PosePublisher(config.odometry)
        self._last_scan_path_m = -np.inf
        self._seen = self._stood = PathPoint(0, Pose2(), 0.0)
        self._estimates = EstimateSchedule()

    def process(self, measurement: Measurement, published: PosePublished | None = None) -> list[Event]:
        """Process the next measurement; returns the events that follow from it, in order.

        `published` is the pose that was published for it already, on an earlier estimate.
        """
        match measurement:
            case Odometry():
                return list(self._process_odometry(measurement, published))
            case LaserScan() | PointCloud():
                return list(self._process_scan(measurement))
            case WifiScan():
                return list(self._process_wifi(measurement))
            case StaticTransforms() | MovingTransforms():
                return list(self._process_transforms(measurement))
            case _:
                return [*self._poses.add(measurement, self._path.latest), *self._use_poses()]

    def finish(self) -> tuple[DriveEstimate, list[Event]]:
        """End the drive: use or drop what still waits, close the last loops, draw the grid."""
        events = list(self._lead_by_transforms(self.stamp_ns)) if self._path.latest is None else []
        events += [event for sweep in self._scans.unfinished() for event in self._add_sweep(sweep)]
        events += [*self._use_scans(last=True), *self._use_last_scans(self._scans.queue.waiting())]
        events += [*self._use_wifi(self._wifi.finish()), *self._poses.finish()]
        result, last = self._core.finish(self._publisher.trajectories)
        return result, events + last

    def new_estimate(self, serial: int) -> Estimate | None:
        """The estimate, if there is news since the last one, or `EstimateSchedule` has one due."""
        keyframes = self._core.keyframe_count
        anchor = self._core.anchor() if keyframes else None
        if not self._estimates.is_due(keyframes, self._odometry.received, anchor is not None):
            return None
        return Estimate(serial, self._odometry.tip(), None if self._stand_ins.lead else anchor)

    def history(self) -> list[Event]:
        """The events with which a new log begins: every keyframe at its present pose, and the grid."""
        return self._core.history(self.stamp_ns)

    def made_map(self) -> BuildingMap | None:
        """The map that the drive has made so far, its grid as drawn last; None where it has made none."""
        return self._core.made_map()

    def edit(self, closure: int, restored: bool) -> list[Event]:
        """Take a closure out of the estimate, or put it back; a new one is due. Raises VetoError."""
        self._estimates = EstimateSchedule(keyframes=-1)
        return self._core.edit(closure, restored)

    def resume(self, seconds: float) -> list[Event]:
        """Go on after `seconds` without measurements; a new estimate is due."""
        self._estimates = EstimateSchedule(keyframes=-1)
        self._path.go_on()
        text = f"away for {seconds:.1f} s: what was driven meanwhile is what the odometry says of it"
        return [Warned(self.stamp_ns, text)]

    @property
    def stamp_ns(self) -> int:
        """The stamp of the newest point of the driven path, 0 before the first."""
        return self._path.latest.stamp_ns if self._path.latest else 0

    def _process_odometry(self, m: Odometry, published: PosePublished | None) -> Iterator[Event]:
        accepted = self._odometry.accept(m)
        if accepted.told:
            yield Warned(accepted.stamp_ns, accepted.told)
        if accepted.ends_stand_in:
            yield from self._stand_ins.end(accepted.stamp_ns)
        if accepted.point:
            self._stand_ins.transforms.restart(m.stamp_ns)
        yield from self._use_odometry(Sensor.ODOM, accepted, m, published)

    def _use_odometry(
        self, sensor: Sensor, accepted: Accepted, m: Odometry, published: PosePublished | None = None, newer_ns: int = 0
    ) -> Iterator[Event]:
        """Use a message of the wheels or a pose of /tf, of which one that is newer by `newer_ns` has come already."""
        if accepted.shift_ns:
            yield Warned(accepted.stamp_ns, f"odometry: {told_of(-accepted.shift_ns, self._odometry.time.offset_ns)}")
        if accepted.dropped:
            yield Dropped(sensor, accepted.stamp_ns, accepted.dropped)
            return
        self._scans.mounts.follow_odometry(m.child_frame_id)
        yield from self._forget_misplaced()
        yield from self._scans.compare(accepted.stamp_ns + newer_ns, self._lead_after_ns)
        yield from self._wifi.compare(accepted.stamp_ns + newer_ns)
        yield from self._follow(accepted, published)

    def _follow(self, accepted: Accepted, published: PosePublished | None = None) -> Iterator[Event]:
        """Use what waited for the path's newest point, then publish the pose in `map`."""
        point = accepted.point
        assert point is not None
        if not accepted.plausible:
            self._core.steps.leapt(self._path.leapt_m, self._path.leapt_rad)
            yield Warned(point.stamp_ns, self._path.leap_text)
        if not self._core.keyframe_count:
            yield from self._core.add_keyframe(point, None)
        yield from self._use_scans()
        yield from self._keyframe_without_scan(point)
        yield from self._use_wifi(self._wifi.ready(self._path))
        yield from self._use_poses()
        yield from self._publisher.add(point, accepted.T_odom_base, self._core.anchor, published)
        yield from self._go_on()

    def _go_on(self) -> Iterator[Event]:
        """Do slices of the work that waits; a pose that is claimed by it is published at once."""
        yield from self._core.go_on(self.stamp_ns)
        yield from self._publisher.catch_up(self._core.anchor)

    def _keyframe_without_scan(self, point: PathPoint) -> Iterator[Event]:
        silent = point.path_m - self._last_scan_path_m >= self._config.lidar.silent_m
        due = silent and keyframe_due(self._core.motion_to(point), self._config.odometry)
        if due and not self._scans.awaits_mount():
            yield from self._core.add_keyframe(point, None)

    def _process_scan(self, m: Sweep) -> Iterator[Event]:
        if not self._config.lidar.enabled:
            yield dropped(m, m.stamp_ns, DropReason.SENSOR_OFF)
            return
        for sweep in (yield from self._scans.receive(self.stamp_ns or m.stamp_ns, m)):
            yield from self._add_sweep(sweep)
        if self._publisher.waits:
            yield from self._go_on()

    def _add_sweep(self, sweep: Sweep) -> Iterator[Event]:
        stamp_ns = yield from self._scans.add(sweep, self._path.latest)
        if stamp_ns is None:
            return
        yield from self._use_scans()
        waits = self._scans.queue.waited_ns > self._lead_after_ns
        if waits and self._stand_ins.transforms.waited_ns > self._lead_after_ns // 2:
            yield from self._lead_by_transforms(stamp_ns)
        elif waits or self._stand_ins.laser_leads:
            yield from self._lead_by_laser(stamp_ns)

    def _lead_by_transforms(self, stamp_ns: int) -> Iterator[Event]:
        """Drive by the odometry in /tf in place of the messages that do not come."""
        waiting = self._stand_ins.transforms.take()
        for m in waiting:
            yield from self._stand_ins.begin_transforms(stamp_ns)
            newer_ns = waiting[-1].stamp_ns - m.stamp_ns
            yield from self._use_odometry(Sensor.TF, self._odometry.follow_transform(m), m, newer_ns=newer_ns)

    def _lead_by_laser(self, stamp_ns: int) -> Iterator[Event]:
        """Drive by scan matching from scan to scan in place of the odometry that does not come."""
        yield from self._stand_ins.begin_laser(stamp_ns)
        yield from self._wifi.compare(stamp_ns)
        for scan_ns, scan in self._scans.queue.waiting():
            latest, leads = self._path.latest, self._stand_ins.follow(scan_ns, scan)
            if leads and (latest is None or scan_ns > latest.stamp_ns):
                yield from self._follow(self._odometry.follow_laser(scan_ns, *self._stand_ins.match(scan_ns, scan)))

    def _use_last_scans(self, waiting: list[tuple[int, Sweep]]) -> Iterator[Event]:
        """At the end: the last scans drive where the laser leads, or odometry never came; else they are dropped."""
        if waiting and (self._stand_ins.laser_leads or self._path.latest is None):
            yield from self._lead_by_laser(waiting[-1][0])
        else:
            yield from (dropped(scan, scan_ns, DropReason.AHEAD) for scan_ns, scan in waiting)

    def _process_transforms(self, m: StaticTransforms | MovingTransforms) -> Iterator[Event]:
        yield from self._scans.mounts.learn(m)
        yield from self._forget_misplaced()
        yield from self._use_scans()
        if isinstance(m, MovingTransforms) and self._stand_ins.add_transforms(m):
            yield from self._lead_by_transforms(m.stamp_ns)

    def _forget_misplaced(self) -> Iterator[Event]:
        """Forget the scans that were placed with a wrong mount; a laser that leads begins anew."""
        forgotten = list(self._corrections.forget_misplaced(self.stamp_ns))
        if forgotten:
            self._stand_ins.begin_laser_anew()
        yield from forgotten

    def _use_scans(self, last: bool = False) -> Iterator[Event]:
        """Use the scans that the path covers; at the `last` even those that wait for their mount."""
        if self._scans.awaits_mount() and not last:
            return
        for sweeps in self._scans.ready(self._path):
            if not isinstance(sweeps, SweepSet):
                yield sweeps
                continue
            point, first = sweeps.point, self._last_scan_path_m == -np.inf
            self._last_scan_path_m = point.path_m
            motion = self._core.motion_to(point)
            due = keyframe_due(motion, self._config.odometry, self._core.steps.keyframe_factor())
            if motion.seconds < 0:
                continue
            if first or due:
                self._seen, placed = point, self._place(sweeps)
                yield from self._scans.judge(sweeps, placed)
                yield from self._core.add_keyframe(point, placed)
                yield from self._corrections.correct_stamps(point.stamp_ns, self._path, self._publisher.trajectories)
            else:
                yield from self._look(sweeps)

    def _look(self, sweeps: SweepSet) -> Iterator[Event]:
        """Now and then compare a scan while the wheels stand still: the robot may move all the same."""
        point = sweeps.point
        stood = self._stood.motion_to(point)
        if not stands(stood.pose):
            self._stood = point
        elif stood.seconds >= self._config.lidar.doubt.look_s and isinstance(sweeps.newest, LaserScan):
            if self._seen.motion_to(point).seconds < self._core.steps.look_due_s():
                return
            self._seen, placed = point, self._place(sweeps)
            yield from self._core.look(point, placed) if placed else ()

    def _place(self, sweeps: SweepSet) -> PlacedScan | None:
        with self._timer("scan_points"):
            return self._scans.place(sweeps, self._path)

    def _process_wifi(self, m: WifiScan) -> Iterator[Event]:
        if not self._config.wifi.enabled:
            yield Dropped(Sensor.WIFI, m.stamp_ns, DropReason.SENSOR_OFF)
            return
        yield from self._wifi.add(m, self._path.latest)
        yield from self._use_wifi(self._wifi.ready(self._path))
        yield from self._go_on()

    def _use_poses(self) -> Iterator[Event]:
        for pose in self._poses.ready(self._path):
            yield from self._core.add_pose(pose) if isinstance(pose, PlacedPose) else (pose,)

    def _use_wifi(self, ready: Iterator[PlacedWifiScan | Event]) -> Iterator[Event]:
        for scan in ready:
            if not isinstance(scan, PlacedWifiScan):
                yield scan
            elif self._core.keyframe_count:
                yield from self._core.add_wifi(self.stamp_ns, scan)
