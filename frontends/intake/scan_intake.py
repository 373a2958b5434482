"""Sweeps of the lasers before they become keyframes: checked, held until the odometry covers them, cut to points."""

import math
from collections.abc import Generator, Iterator

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.intake.cloud_intake import CloudIntake, has_return
from wayfi.frontends.intake.companions import Companions
from wayfi.frontends.intake.mounts import Mounts
from wayfi.frontends.intake.scan_queue import ScanQueue, sweep_ns
from wayfi.frontends.intake.sensor_clock import SensorClock
from wayfi.frontends.intake.sweep_sets import SweepSet, SweepSets
from wayfi.frontends.intake.use_watch import UseWatch
from wayfi.frontends.lasers.laser import Laser, Lasers
from wayfi.frontends.lidar.laser_points import beam_points, scan_from_points, sees_anything, to_base
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.measurements import (
    NANOSECOND_S,
    SECOND_NS,
    LaserScan,
    PointCloud,
    Sensor,
    Sweep,
    content_of,
)
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.timebase import TimeBase
from wayfi.frontends.scan_points import PlacedScan, ScanPoints, joined, moved

MOUNT_WAIT_SHARE = 0.5  # of the wait for odometry: /tf_static is latched, and comes at once where it is sent


class ScanIntake:
    """Uses the first kind of laser that sees anything, planar or 3D, and all of that kind that have mounts together.

    Holds their sweeps in `queue`, and knows the `mounts`. Their stamps are brought onto the `time` of the odometry.
    """

    def __init__(self, config: LidarConfig, odometry: OdometryConfig, time: TimeBase) -> None:
        self._config = config
        self._mount_wait_ns = round(MOUNT_WAIT_SHARE * odometry.laser_lead_s * SECOND_NS)
        self.mounts = Mounts(config, odometry.base_frame)
        self.clouds = CloudIntake(config, self.mounts)
        self.queue = ScanQueue()
        self._lasers = Lasers(config.watch)
        self._clock, self._time = odometry.clock, time
        self._clocks: dict[str, SensorClock] = {}
        self._companions = Companions(self.mounts, bool(config.mount))
        self._sets = SweepSets()
        self._use = UseWatch(config, self.clouds)
        self._kind: Sensor | None = None
        self._shift_ns = 0

    def awaits_mount(self) -> bool:
        """Whether the next sweep waits for its mount, which is not known."""
        oldest = self.queue.oldest
        return (
            oldest is not None and self.mounts.awaits(oldest.frame_id) and self.queue.waited_ns <= self._mount_wait_ns
        )

    def receive(self, now_ns: int, sweep: Sweep) -> Generator[Event, None, list[Sweep]]:
        """Check a sweep as it was sent, at `now_ns` of the odometry; returns the whole sweeps that it completes."""
        if isinstance(sweep, PointCloud):
            return [sweep]
        return list((yield from self._lasers.of(sweep).receive(now_ns, sweep)))

    def unfinished(self) -> list[Sweep]:
        """At the end: the turns of which fragments are missing."""
        return [sweep for laser in self._lasers for sweep in laser.finish()]

    def laser_of(self, sweep: Sweep) -> Laser:
        """The laser that a sweep is from."""
        return self._lasers.of(sweep)

    def add(self, sweep: Sweep, latest: PathPoint | None) -> Generator[Event, None, int | None]:
        """Add a sweep; `latest` is the end of the driven path.

        Returns its stamp by the odometry's clock, None if it is dropped.
        """
        laser, sensor = self._lasers.of(sweep), sensor_of(sweep)
        stamp_ns = yield from self._stamp(laser, sweep)
        if stamp_ns is None:
            return None
        if sensor is not (self._kind or sensor):
            yield dropped(sweep, stamp_ns, DropReason.OTHER_LASER)
            return None
        stamp_ns += self._shift_ns
        late_ns = latest.stamp_ns - stamp_ns if latest else 0
        used = yield from laser.watch.add_sweep(stamp_ns, sweep, late_ns)
        if used is None:
            return None
        sees = self._sees_anything(used)
        yield from self._use.add_sweep(stamp_ns, laser.name, sweep, sees)
        if not sees:
            yield dropped(sweep, stamp_ns, DropReason.NO_RETURN)
            return None
        self._kind = sensor
        for oldest in self.queue.add(stamp_ns, used):
            yield dropped(oldest, oldest.stamp_ns, DropReason.TOO_MANY_WAIT)
        return stamp_ns

    def ready(self, path: DrivenPath) -> Iterator[SweepSet | Event]:
        """Remove and return the sweeps that the path covers, those of several lasers together; and what is dropped."""
        for point, sweep in self.queue.ready(path):
            self.mounts.settle(sweep.frame_id)
            if point is None:
                yield dropped(sweep, sweep.stamp_ns, DropReason.TOO_LATE)
                continue
            laser = self._lasers.of(sweep)
            if self._companions.takes(point.stamp_ns, sweep.frame_id):
                yield from self._sets.add(laser.stream, point, sweep)
                continue
            yield dropped(sweep, point.stamp_ns, DropReason.NO_TRANSFORM)
            yield from self._companions.tell(point.stamp_ns, laser.name)

    def compare(self, odometry_ns: int, most_ahead_ns: int) -> Iterator[Event]:
        """Drop the sweeps stamped more than `most_ahead_ns` after the newest odometry; watch for silence."""
        yield from self.drop_ahead(odometry_ns + most_ahead_ns)
        for laser in self._lasers:
            yield from laser.watch.check_silence(odometry_ns)

    def drop_ahead(self, stamp_ns: int) -> Iterator[Event]:
        """Drop the sweeps that wait and are stamped after `stamp_ns`."""
        for ahead in self.queue.drop_ahead(stamp_ns):
            yield dropped(ahead, ahead.stamp_ns, DropReason.AHEAD)

    def shift_stamps(self, seconds: float) -> None:
        """Add `seconds` to the stamps of the sweeps from here on."""
        self._shift_ns += round(seconds * SECOND_NS)

    def led(self, scan: LaserScan, velocity: Floats) -> tuple[Floats, ScanPoints]:
        """(n, 2) points of a scan in base_link at its stamp, m, if its laser moves with `velocity`; also with normals.

        `velocity` (3,) is in m/s and rad/s of base_link.
        """
        beams, points = beam_points(scan, self._config.max_range_m)
        mount = self.mounts.of(scan.frame_id)
        share = beams / max(len(scan.ranges), 1)
        points = to_base(points, mount, share[:, None] * velocity * (sweep_ns(scan) * NANOSECOND_S))
        return points, scan_from_points(points, mount.planar, self._config)

    def place(self, sweeps: SweepSet, path: DrivenPath) -> PlacedScan | None:
        """The points of all sweeps in base_link at the newest; None if no beam returned."""
        to_newest = sweeps.point.T_path_base
        placed = [
            scan if point is sweeps.point else moved(scan, to_newest.between(point.T_path_base))
            for point, sweep in sweeps.members
            if (scan := self._place(point, sweep, path)) is not None
        ]
        return joined(placed) if placed else None

    def judge(self, sweeps: SweepSet, placed: PlacedScan | None) -> Iterator[Event]:
        """Tell what keeps a keyframe's sweeps from being used, if anything does."""
        for _, sweep in sweeps.members:
            yield from self.mounts.warn_of_unknown(sweep)
        newest = sweeps.newest
        yield from self._use.judge(sweeps.point.stamp_ns, self._lasers.of(newest).name, newest, placed)

    def _stamp(self, laser: Laser, sweep: Sweep) -> Generator[Event, None, int | None]:
        """The stamp of a sweep on the time base, None if it is dropped.

        Where the stamps turn out to have been ahead, so were those of the sweeps that wait after it: these are dropped.
        """
        if laser.stream not in self._clocks:
            self._clocks[laser.stream] = SensorClock(self._clock, self._time)
        stamped = self._clocks[laser.stream].accept(sweep.stamp_ns, lambda: content_of(sweep))
        if stamped.told:
            yield Warned(stamped.stamp_ns, f"{laser.name}: {stamped.told}")
        if stamped.dropped:
            yield dropped(sweep, stamped.stamp_ns, stamped.dropped)
            return None
        if stamped.shift_ns < 0:
            yield from self.drop_ahead(stamped.stamp_ns)
        return stamped.stamp_ns

    def _place(self, point: PathPoint, sweep: Sweep, path: DrivenPath) -> PlacedScan | None:
        self.mounts.mark_used(sweep)
        if isinstance(sweep, PointCloud):
            return self.clouds.place(point, sweep, path)
        beams, points = beam_points(sweep, self._config.max_range_m)
        if len(points) == 0:
            return None
        mount = self.mounts.of(sweep.frame_id)
        points = to_base(points, mount, _sweep_motion(point, sweep, beams, path))
        return PlacedScan(scan_from_points(points, mount.planar, self._config), points.astype(np.float32))

    def _sees_anything(self, sweep: Sweep) -> bool:
        """Whether a scan holds a return within the maximum range, a cloud one at all."""
        if isinstance(sweep, PointCloud):
            return has_return(sweep)
        return sees_anything(sweep, self._config.max_range_m)


def sensor_of(sweep: Sweep) -> Sensor:
    """The sensor that a sweep is from."""
    return Sensor.POINTS if isinstance(sweep, PointCloud) else Sensor.SCAN


def dropped(sweep: Sweep, stamp_ns: int, reason: DropReason) -> Dropped:
    """The event of a sweep that is not used."""
    return Dropped(sensor_of(sweep), stamp_ns, reason, sweep.topic if isinstance(sweep, LaserScan) else "")


def _sweep_motion(point: PathPoint, scan: LaserScan, beams: NDArray[np.int64], path: DrivenPath) -> Floats | None:
    """(n, 3) motion of the base from the scan's stamp to each beam; None for a sweep that takes no time."""
    duration = sweep_ns(scan)
    end = path.at(point.stamp_ns + duration)
    if duration == 0 or end is None:
        return None
    motion = point.T_path_base.between(end.T_path_base).array()
    if not math.isfinite(float(motion.sum())):
        return None
    share: Floats = beams / max(len(scan.ranges), 1)
    return share[:, None] * motion
