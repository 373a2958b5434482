"""Short drives with planar lasers, changed at will, through a pipeline of their own."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import Dropped, DropReason, Event, KeyframeAdded, Warned
from wayfi.frontends.measurements import LaserScan, Measurement, Odometry, StaticTransforms, Transform
from wayfi.frontends.pipeline import Pipeline
from wayfi.recordings.simulation import run as simulation
from wayfi.recordings.simulation.run import start
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import load_config
from wayfi.service.evaluation.trajectory_scores import absolute_error

GOOD_M = 0.03  # ATE in the car park: 0.005 as it was simulated, 0.28 by the wheels alone
FRONT, REAR = Pose2(0.3, 0.05, 0.0), Pose2(-0.3, -0.05, math.pi)
Change = Callable[[LaserScan], list[LaserScan]]


@dataclass(frozen=True)
class Drive:
    """What was measured, and where the robot was."""

    measurements: list[Measurement]
    truth: Trajectory

    def with_scans(self, change: Change) -> "Drive":
        """The drive with what `change` makes of each scan."""
        out: list[Measurement] = []
        for m in self.measurements:
            out += change(m) if isinstance(m, LaserScan) else [m]
        return Drive(out, self.truth)


@dataclass(frozen=True)
class Run:
    """What came of a drive."""

    ate_m: float
    events: list[Event]

    @property
    def told(self) -> str:
        return "\n".join(e.text for e in self.events if isinstance(e, Warned) and not e.ends)

    def dropped(self) -> list[DropReason]:
        return [e.reason for e in self.events if isinstance(e, Dropped)]

    def scans(self) -> int:
        """How many keyframes hold a scan."""
        return sum(isinstance(e, KeyframeAdded) and len(e.points) > 0 for e in self.events)


def run(drive: Drive, *settings: str) -> Run:
    pipeline = Pipeline(load_config((), settings))
    events = [e for m in drive.measurements for e in pipeline.process(m)]
    result, last = pipeline.finish()
    error = absolute_error(Trajectory(result.stamps_ns, result.final), drive.truth).error
    return Run(error.ate_rmse_m, events + last)


def simulated(mount: Pose2, frame: str, world: World = World.CARPARK, delay_s: float = 0.0) -> Drive:
    """45 s, every third beam of the laser's 270 degrees; each scan is taken `delay_s` later."""
    made = start(world, 0, 0.75)
    made = replace(made, T_base_laser=mount, scan_delay_ns=made.scan_delay_ns + round(delay_s * 1e9))
    measured = [m for m in simulation.measurements(made) if isinstance(m, Odometry | LaserScan)]
    half = math.sin(mount.theta / 2), math.cos(mount.theta / 2)
    static = Transform("base_link", frame, (mount.x, mount.y, 0.2), (0.0, 0.0, *half))
    first: list[Measurement] = [StaticTransforms(measured[0].stamp_ns, (static,))]
    return Drive(first + [thinned(m, frame) if isinstance(m, LaserScan) else m for m in measured], made.truth)


def thinned(scan: LaserScan, frame: str) -> LaserScan:
    ranges, step = scan.ranges[::3], 3 * scan.angle_increment
    end, each_s = scan.angle_min + (len(ranges) - 1) * step, 3 * scan.time_increment_s
    return replace(scan, frame_id=frame, ranges=ranges, angle_increment=step, angle_max=end, time_increment_s=each_s)


def each(**how: Callable[[LaserScan], object]) -> Change:
    """Every scan with some of its numbers replaced."""
    return lambda scan: [replace(scan, **{name: value(scan) for name, value in how.items()})]  # type: ignore[arg-type]


def last_bearing(scan: LaserScan) -> float:
    assert scan.angle_max is not None
    return scan.angle_max


def clockwise(scan: LaserScan) -> list[LaserScan]:
    ends = {"angle_min": last_bearing(scan), "angle_max": scan.angle_min, "angle_increment": -scan.angle_increment}
    return [replace(scan, ranges=scan.ranges[::-1], time_increment_s=0.0, **ends)]


def cut(scan: LaserScan, pieces: int, stamped: bool = True) -> Iterator[LaserScan]:
    """The scan in so many pieces, each stamped when it was measured, or all as the scan was."""
    size = math.ceil(len(scan.ranges) / pieces)
    for first in range(0, len(scan.ranges), size):
        ranges = scan.ranges[first : first + size]
        begin = scan.angle_min + first * scan.angle_increment
        late_ns = round(first * scan.time_increment_s * 1e9) if stamped else 0
        ends = {"angle_min": begin, "angle_max": begin + (len(ranges) - 1) * scan.angle_increment}
        yield replace(scan, stamp_ns=scan.stamp_ns + late_ns, ranges=ranges, **ends)
