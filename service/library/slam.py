"""SLAM on the sensors of a running robot: messages in, a pose after each; the same pipeline as in a replay."""

import math
import os
import time
from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayfi.backend.errors import WayfiError
from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import Event, GridRedrawn, PosePublished
from wayfi.frontends.measurements import SECOND_NS, Measurement, Sensor, Sweep
from wayfi.recordings.files.calibration_file import read_calibration
from wayfi.recordings.files.tables import closure_row
from wayfi.recordings.files.trinary_grid import TrinaryGrid, trinary
from wayfi.recordings.log import NullLog
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import load_config
from wayfi.service.drive.drive import Drive
from wayfi.service.drive.results import Source, report_of, write_results

from . import arguments
from .arguments import ArgumentError
from .compiling import compile_first
from .configuring import Given, files_of, settings_of
from .rerun_file import RerunFile
from .results import Result
from .stamp_order import StampOrder

ByBssid = Mapping[str, float]


class FinishedError(WayfiError):
    """A message or a second `finish` came after a Slam had finished."""


class Slam:
    """One drive. Feed it what the sensors say, each with its stamp in integer nanoseconds of one clock.

    Messages of one sensor must come in the order of their stamps; those of different sensors may overtake each other.
    A clock that is set on the way is followed, as in a recording: five messages in a row have to agree on it.
    Every `add_...` returns the events that became known by the message (wayfi.frontends.events), and raises
    ArgumentError, leaving everything as it was, for what cannot be right, and FinishedError after `finish`. It is not
    safe to use from several threads at a time.
    """

    def __init__(
        self,
        config: Given = None,
        *,
        calibration: str | os.PathLike[str] | None = None,
        rrd: str | os.PathLike[str] | None = None,
        **settings: object,
    ) -> None:
        """Begin a drive; the first time on a machine this compiles for half a minute, later it loads for 2 s.

        `config` is a TOML file or nested mappings, `settings` override it by `section.key`, `calibration` is the
        calibration.toml of an earlier drive. `rrd` is a Rerun file that is written as the drive goes; where that fails
        on the way, the logger `wayfi` and the report say so, and the drive goes on without it. Raises ArgumentError
        for arguments that cannot be used, `rrd` that cannot be written among them, and WayfiError for a configuration
        or a calibration that is wrong.
        """
        configured = load_config(files_of(config), settings_of(config, settings))
        prior = None if calibration is None else read_calibration(arguments.path_of(calibration, "calibration"))
        self._rrd_path = None if rrd is None else arguments.path_of(rrd, "rrd")
        self._rrd = None if self._rrd_path is None else RerunFile(configured.rerun, self._rrd_path)
        compile_first()
        self._drive = Drive(configured, prior, self._rrd or NullLog())
        self._swept: set[str] = set()  # the frames that scans came from
        self._order = StampOrder(round(configured.odometry.clock.lasting_jump_s * SECOND_NS))
        self._published: PosePublished | None = None
        self._drawn: GridRedrawn | None = None
        self._stamps_ns: tuple[int, int] | None = None
        self._begun_s = time.monotonic()
        self._finished = False

    @property
    def pose(self) -> Pose2 | None:
        """The pose of base_link in `map` at the newest odometry (or scan, without odometry); None before the first."""
        if self._published is None:
            return None
        T_map_base = self._published.T_map_base
        return Pose2(float(T_map_base.x), float(T_map_base.y), float(T_map_base.theta))

    @property
    def covariance(self) -> NDArray[np.float64] | None:
        """(3, 3) of `pose` in (x, y, theta) of `map`, m and rad; None before the first."""
        return self._published.covariance.copy() if self._published else None

    @property
    def state(self) -> State | None:
        """How far `pose` can be trusted: TRACKING, UNCERTAIN or LOST; None before the first."""
        return self._published.state if self._published else None

    @property
    def grid(self) -> TrinaryGrid | None:
        """The occupancy grid as it was last drawn, None before."""
        drawn = self._drawn
        if drawn is None:
            return None
        return trinary(drawn.occupancy, drawn.resolution_m, drawn.origin_xy_m, self._drive.config.map)

    def set_mount(self, mount: ArrayLike, frame_id: str = "laser") -> list[Event]:
        """Set the pose of the laser `frame_id` in base_link, before its first scan; without this it is at base_link.

        `mount` is (x, y, theta), or (x, y, z, qx, qy, qz, qw) where it is tilted, upside down or 3D; m and rad.
        """
        self._refuse_if_finished()
        transforms = arguments.mount_of(mount, frame_id)
        if frame_id in self._swept:
            raise ArgumentError(f"frame_id: the mount must be set before the first scan of {frame_id!r}")
        return self._add(Sensor.TF_STATIC, transforms)

    def add_odometry(self, t_ns: int, x: float, y: float, theta: float) -> list[Event]:
        """Add the pose (m, m, rad) of base_link in `odom` that the wheels measured; it may drift.

        theta may count turns: degrees cannot be told from radians here.
        """
        return self._add_in_order("odometry", Sensor.ODOM, arguments.odometry_of(t_ns, x, y, theta))

    def add_scan(
        self,
        t_ns: int,
        ranges: ArrayLike,
        *,
        angle_min: float,
        angle_increment: float,
        range_min: float = 0.0,
        range_max: float = math.inf,
        time_increment: float = 0.0,
        frame_id: str = "laser",
    ) -> list[Event]:
        """Add a sweep of a planar laser, as in sensor_msgs/LaserScan.

        Beam i of `ranges` (n,) m points to `angle_min + i * angle_increment` (rad) and was measured
        `i * time_increment` (s; 0: unknown) after `t_ns`. A range that is not finite, masked, or outside of the limits
        is no return. Each `frame_id` is a laser of its own, and all of them are used together.
        """
        scan = arguments.scan_of(
            t_ns, ranges, angle_min, angle_increment, range_min, range_max, time_increment, frame_id
        )
        return self._add_sweep(f"scan of {frame_id!r}", Sensor.SCAN, scan)

    def add_points(
        self, t_ns: int, points: ArrayLike, *, point_times: ArrayLike | None = None, frame_id: str = "lidar"
    ) -> list[Event]:
        """Add a sweep of a 3D LiDAR: `points` (n, 3) m in its frame, measured `point_times` (n,) s after `t_ns`."""
        cloud = arguments.cloud_of(t_ns, points, point_times, frame_id)
        return self._add_sweep(f"points of {frame_id!r}", Sensor.POINTS, cloud)

    def add_wifi(
        self, t_ns: int, rssi: ByBssid, *, receiver: str = "wifi", age: float | ByBssid | None = None
    ) -> list[Event]:
        """Add a WiFi scan that ended at `t_ns`: the RSSI (dBm) by BSSID.

        `receiver` names the adapter, each of which has its own offset; `age` is how many seconds before `t_ns` a
        reading was measured, one number for all or by BSSID.
        """
        scan = arguments.wifi_of(t_ns, rssi, receiver, age)
        return self._add_in_order(f"wifi of {receiver!r}", Sensor.WIFI, scan)

    def finish(self) -> Result:
        """End the drive: closes the last loops, smooths once more and draws the grid. Raises FinishedError."""
        self._refuse_if_finished()
        self._finished = True
        drive, ended = self._drive, self._drive.finish()
        first_ns, last_ns = self._stamps_ns or (0, 0)
        warnings = [self._rrd.warning] if self._rrd and self._rrd.warning else []
        source = Source(time.monotonic() - self._begun_s, (last_ns - first_ns) / SECOND_NS, "", warnings)
        building = ended.building
        grid = building.grid
        return Result(
            Trajectory(ended.stamps_ns, ended.final),
            Trajectory(ended.stamps_ns[ended.published], ended.online[ended.published]),
            [closure_row(verdict) for verdict in drive.counters.verdicts.values()],
            trinary(grid.probability(), grid.resolution_m, grid.origin_xy_m, drive.config.map),
            building.calibration,
            report_of(drive, source),
            partial(write_results, drive=drive, estimate=ended, source=source),
            self._rrd_path,
        )

    def _add_sweep(self, stream: str, sensor: Sensor, sweep: Sweep) -> list[Event]:
        events = self._add_in_order(stream, sensor, sweep)
        self._swept.add(sweep.frame_id)
        return events

    def _add_in_order(self, stream: str, sensor: Sensor, measurement: Measurement) -> list[Event]:
        self._refuse_if_finished()
        stamp_ns = measurement.stamp_ns
        self._order.add(stream, stamp_ns)
        first_ns, last_ns = self._stamps_ns or (stamp_ns, stamp_ns)
        self._stamps_ns = min(first_ns, stamp_ns), max(last_ns, stamp_ns)
        return self._add(sensor, measurement)

    def _add(self, sensor: Sensor, measurement: Measurement) -> list[Event]:
        events = self._drive.add(sensor, measurement)
        for event in events:
            if isinstance(event, PosePublished):
                self._published = event
            elif isinstance(event, GridRedrawn):
                self._drawn = event
        self._drive.show(events)
        return events

    def _refuse_if_finished(self) -> None:
        if self._finished:
            raise FinishedError("this Slam has finished; begin another drive with another Slam")
