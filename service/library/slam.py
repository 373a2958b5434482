"""SLAM on the sensors of a running robot: messages in, a pose after each; the same pipeline as in a replay."""

import math
import time
import uuid
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayfi.backend.errors import WayfiError
from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import Event, GridRedrawn, PosePublished
from wayfi.frontends.measurements import Measurement, Sensor
from wayfi.recordings.files.calibration_file import read_calibration
from wayfi.recordings.files.tables import closure_row
from wayfi.recordings.files.trinary_grid import TrinaryGrid, trinary
from wayfi.recordings.log import Log, NullLog
from wayfi.recordings.rerun.log_process import LogProcess, Part
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import Config, load_config
from wayfi.service.drive.drive import Drive
from wayfi.service.drive.results import Source, report_of, write_results

from . import arguments
from .compiling import compile_first
from .configuring import Given, files_of, settings_of
from .results import Result
from .stamp_order import StampOrder

Levels = Mapping[str, float]


class FinishedError(WayfiError):
    """A Slam that has finished takes no more messages."""


class Slam:
    """One drive. Feed it what the sensors say, each with its stamp in integer nanoseconds of one clock.

    Messages of one sensor must come in the order of their stamps; those of different sensors may overtake each other.
    Every `add_...` returns the events that became known by the message (wayfi.frontends.events), and raises
    ArgumentError, leaving everything as it was, for what cannot be right. It is not safe to use from several threads
    at a time.
    """

    def __init__(
        self,
        config: Given = None,
        *,
        calibration: str | Path | None = None,
        rrd: str | Path | None = None,
        **settings: object,
    ) -> None:
        """Begin a drive; the first time on a machine this compiles for half a minute.

        `config` is a TOML file, `settings` override it by `section.key`, `calibration` is the calibration.toml of an
        earlier drive, `rrd` a Rerun file that is written as the drive goes. Raises WayfiError.
        """
        configured = load_config(files_of(config), settings_of(settings))
        prior = None if calibration is None else read_calibration(Path(calibration))
        compile_first()
        self._drive = Drive(configured, prior, _open_log(configured, rrd))
        self._order = StampOrder()
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
        """Say where a laser is on base_link, which is where it is taken to be without this; before its first scan.

        `mount` is (x, y, theta), or (x, y, z, qx, qy, qz, qw) where it is tilted, upside down or 3D; m and rad.
        """
        return self._add(Sensor.TF_STATIC, arguments.mount_of(mount, frame_id))

    def add_odometry(self, t_ns: int, x: float, y: float, theta: float) -> list[Event]:
        """Add where the wheels believe to be: the pose (m, m, rad) of base_link in `odom`, which may drift."""
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

        Beam i of `ranges` (n,) m points to `angle_min + i * angle_increment` (rad) and was taken at `t_ns` and
        `i * time_increment` (s; 0: unknown). What is not finite or outside of the limits is no return.
        """
        scan = arguments.scan_of(
            t_ns, ranges, angle_min, angle_increment, range_min, range_max, time_increment, frame_id
        )
        return self._add_in_order("scan", Sensor.SCAN, scan)

    def add_points(
        self, t_ns: int, points: ArrayLike, *, point_times: ArrayLike | None = None, frame_id: str = "lidar"
    ) -> list[Event]:
        """Add a sweep of a 3D LiDAR: `points` (n, 3) m in its frame, taken `point_times` (n,) s after `t_ns`."""
        cloud = arguments.cloud_of(t_ns, points, point_times, frame_id)
        return self._add_in_order("points", Sensor.POINTS, cloud)

    def add_wifi(
        self, t_ns: int, levels: Levels, *, receiver: str = "wifi", age: float | Levels | None = None
    ) -> list[Event]:
        """Add a WiFi scan that ended at `t_ns`: dBm by BSSID.

        `receiver` names the adapter, each of which has its own offset; `age` is how many seconds before `t_ns` a
        reading was taken, one number for all or by BSSID.
        """
        scan = arguments.wifi_of(t_ns, levels, receiver, age)
        return self._add_in_order(f"wifi of {receiver!r}", Sensor.WIFI, scan)

    def finish(self) -> Result:
        """End the drive: closes the last loops, smooths once more and draws the grid. Raises FinishedError."""
        self._refuse_if_finished()
        self._finished = True
        drive, ended = self._drive, self._drive.finish()
        first_ns, last_ns = self._stamps_ns or (0, 0)
        source = Source(time.monotonic() - self._begun_s, (last_ns - first_ns) * 1e-9, "", [])
        grid = ended.grid
        return Result(
            Trajectory(ended.stamps_ns, ended.final),
            Trajectory(ended.stamps_ns, ended.online),
            [closure_row(verdict) for verdict in drive.counters.verdicts.values()],
            trinary(grid.probability(), grid.resolution_m, grid.origin_xy_m, drive.config.map),
            ended.calibration,
            report_of(drive, source),
            lambda out: write_results(out, drive, ended, source),
        )

    def _add_in_order(self, stream: str, sensor: Sensor, measurement: Measurement) -> list[Event]:
        self._refuse_if_finished()
        stamp_ns = measurement.stamp_ns
        self._order.add(stream, stamp_ns)
        first_ns, last_ns = self._stamps_ns or (stamp_ns, stamp_ns)
        self._stamps_ns = min(first_ns, stamp_ns), max(last_ns, stamp_ns)
        return self._add(sensor, measurement)

    def _add(self, sensor: Sensor, measurement: Measurement) -> list[Event]:
        self._refuse_if_finished()
        events = self._drive.add(sensor, measurement)
        self._drive.show(events)
        for event in events:
            if isinstance(event, PosePublished):
                self._published = event
            elif isinstance(event, GridRedrawn):
                self._drawn = event
        return events

    def _refuse_if_finished(self) -> None:
        if self._finished:
            raise FinishedError("this Slam has finished; begin another drive with another Slam")


def _open_log(config: Config, rrd: str | Path | None) -> Log:
    if rrd is None:
        return NullLog()
    return LogProcess(Part(config.rerun, Path(rrd), uuid.uuid4().hex[:16]))
