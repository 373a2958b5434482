"""Poses from outside before they are used: checked, brought to the time base, held until the path covers them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.frames.frame_tree import frame_name
from wayfi.frontends.frames.frames_config import FramesConfig
from wayfi.frontends.measurements import SECOND_NS, OutsidePose, PoseFix, Sensor
from wayfi.frontends.odometry.accepted_odometry import fault_of
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.odometry.timebase import TimeBase

AHEAD_NS = 5 * SECOND_NS  # of the odometry: a fix waits that long for it, as WiFi scans do
MOST_WAITING = 100  # fixes, to bound memory: 3 s of a camera that sees a fiducial
TINIEST, LARGEST = 1e-12, 1e12  # m^2, rad^2, of a variance: beyond are rounding, and numbers without a meaning
_WHY = {
    DropReason.OTHER_FRAME: "its frame is {frame!r}, not {map!r}; send it in that frame (or see frames.map)",
    DropReason.ABSURD_COVARIANCE: "its covariance is not positive definite; send the variances of x, y and yaw, "
    "or zeros where they are not known",
    DropReason.NON_FINITE: "it holds numbers that are not finite, or a quaternion of zeros",
    DropReason.IMPLAUSIBLE_MOTION: "it is further off than any building is wide; send m",
}


@dataclass(frozen=True, slots=True, eq=False)
class PlacedPose:
    """A pose from outside (`sensor`: a fix or an initial pose) at its `point` of the path.

    `covariance` is (3, 3) in (x, y, theta) of `map`, m and rad, or None where it is not known.
    """

    sensor: Sensor
    point: PathPoint
    T_map_base: Pose2
    covariance: Floats | None


class PoseIntake:
    """Drops poses from outside that cannot be used, and holds the others until they have a place on the path.

    Their stamps are of the odometry's clock, and 0 means now. So does the stamp of an initial pose that the path does
    not cover: the person who gave it looked at the robot.
    """

    def __init__(self, frames: FramesConfig, odometry: TimeBase) -> None:
        self._map = frames.map
        self._odometry = odometry
        self._waiting: list[OutsidePose] = []
        self._told: set[tuple[Sensor, DropReason]] = set()

    def add(self, m: OutsidePose, latest: PathPoint | None) -> Iterator[Event]:
        """Add the next pose; `latest` is the end of the driven path."""
        if reason := self._fault_of(m):
            yield from self._drop_faulty(m, reason)
            return
        if m.stamp_ns:
            m = replace(m, stamp_ns=m.stamp_ns + self._odometry.offset_ns)
        if isinstance(m, PoseFix) and latest and m.stamp_ns > latest.stamp_ns + AHEAD_NS:
            yield _dropped(m, DropReason.AHEAD)
            return
        self._waiting.append(m)
        if len(self._waiting) > MOST_WAITING:
            yield _dropped(self._waiting.pop(0), DropReason.TOO_MANY_WAIT)

    def ready(self, path: DrivenPath) -> Iterator[PlacedPose | Event]:
        """Remove and return the poses that the path covers, each at its place; and what is dropped."""
        latest = path.latest
        if latest is None or not self._waiting:
            return
        waiting, self._waiting = self._waiting, []
        for m in waiting:
            is_fix = isinstance(m, PoseFix)
            if is_fix and m.stamp_ns > latest.stamp_ns:
                self._waiting.append(m)
                continue
            point = path.at(m.stamp_ns) if m.stamp_ns else latest
            if point is None and is_fix:
                yield _dropped(m, DropReason.TOO_LATE)
            else:
                yield PlacedPose(_sensor_of(m), point or latest, m.T_map_base, m.covariance)

    def finish(self) -> Iterator[Event]:
        """At the end: drop what is ahead of the odometry."""
        yield from (_dropped(m, DropReason.AHEAD) for m in self._waiting)

    def _drop_faulty(self, m: OutsidePose, reason: DropReason) -> Iterator[Event]:
        """Drop a pose; the first of each sensor and reason is told."""
        yield _dropped(m, reason)
        sensor = _sensor_of(m)
        if (sensor, reason) not in self._told:
            self._told.add((sensor, reason))
            kind = "a fix" if sensor is Sensor.FIX else "an initial pose"
            yield Warned(m.stamp_ns, f"{kind} is not used: {_WHY[reason].format(frame=m.frame_id, map=self._map)}")

    def _fault_of(self, m: OutsidePose) -> DropReason | None:
        if frame_name(m.frame_id) != frame_name(self._map):
            return DropReason.OTHER_FRAME
        if m.covariance is not None and not np.isfinite(m.covariance).all():
            return DropReason.NON_FINITE
        if m.covariance is not None and not is_covariance(m.covariance):
            return DropReason.ABSURD_COVARIANCE
        return fault_of(m.T_map_base)


def _sensor_of(m: OutsidePose) -> Sensor:
    return Sensor.FIX if isinstance(m, PoseFix) else Sensor.INITIAL_POSE


def _dropped(m: OutsidePose, reason: DropReason) -> Dropped:
    return Dropped(_sensor_of(m), m.stamp_ns, reason)


def is_covariance(matrix: Floats) -> bool:
    """Whether a finite (3, 3) `matrix` is symmetric but for rounding, and positive definite."""
    if np.abs(matrix).max() > LARGEST or not np.allclose(matrix, matrix.T, rtol=1e-6, atol=TINIEST):
        return False
    return float(np.linalg.eigvalsh(matrix)[0]) > TINIEST
