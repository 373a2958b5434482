"""The bearings of a scan's beams: its numbers are checked against each other, and corrected where one is wrong.

A beam's bearing is `angle_min + i * angle_increment`; angle_max should be that of the last beam. Where it contradicts
by many beams, walls tell: they are straight by the right increment and bent by a wrong one.
"""

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.pose2 import Floats, wrap
from wayfi.frontends.measurements import LaserScan

TURN_RAD = 2 * math.pi
SPARE_BEAMS, SPARE_SHARE = 3.0, 0.02  # that angle_max may be off: drivers count a beam too many, or lose some of a turn
LARGEST_RAD = 1.05 * TURN_RAD  # of a bearing: a larger number is in degrees
LARGEST_DEGREES = 1.05 * 360.0
SMALLEST_VIEW_RAD = 0.02  # of all beams together: less covers nothing
LEAST_DEGREES_VIEW_RAD = 0.5  # more turns than one, read as degrees, are a narrower view than any scanner's
WINDOWS = 12  # of neighbouring beams, in which walls are looked for: 30 degrees of a turn each
LEAST_WINDOW = 8  # beams
LARGEST_STEP = 0.15  # of the range, from one beam to the next on a wall
ENOUGH_WINDOWS = 40  # a decision rests on: of some scans, in a room
CLEAR_SHARE = 0.65  # of the windows in which one increment makes the straighter wall; chance gives half
MOST_SCANS = 20  # that the decision may take: then the walls do not tell
DRIVER = "correct its driver"


@dataclass(frozen=True, slots=True)
class Bearings:
    """What a scan's numbers say of its beams: `start` and `step` (rad), or None where they say nothing possible.

    `fault` is what is wrong with them, empty where they are sound. `other` is another step, as possible as the first.
    """

    start: float
    step: float | None
    fault: str = ""
    other: float | None = None


def bearings_of(scan: LaserScan) -> Bearings:
    """The bearings of a scan, by its angle_min, angle_increment and, where it says one, angle_max."""
    start, step, beams = scan.angle_min, scan.angle_increment, len(scan.ranges)
    end = scan.angle_max if scan.angle_max and math.isfinite(scan.angle_max) else None  # 0 is mostly left out
    if not math.isfinite(start) or max(abs(start), abs(end or 0.0)) > LARGEST_DEGREES:
        return Bearings(0.0, None, f"angle_min {start:g} and angle_max {end} are no angles; its scans are not used")
    degrees = ""
    if max(abs(start), abs(end or 0.0)) > LARGEST_RAD:
        degrees = f"angle_min {start:g} is in degrees: converted to radians; {DRIVER}"
        start, end = math.radians(start), None if end is None else math.radians(end)
    if beams < 2:
        return Bearings(start, step if math.isfinite(step) else 0.0, degrees)
    return _with_step(start, step, end, beams, degrees)


def _with_step(start: float, step: float, end: float | None, beams: int, degrees: str) -> Bearings:
    """As `bearings_of`, for bearings in radians; `degrees` is what was wrong with their unit."""
    in_degrees, spread = math.radians(step), math.nan if end is None else (end - start) / (beams - 1)
    if _is_possible(step, beams) and (end is None or _ends_at(start, step, beams, end)):
        return Bearings(start, step, degrees)
    from_degrees = f"angle_increment {step:g} is in degrees: converted to radians; {DRIVER}"
    if end is None:
        read = (
            in_degrees if abs(in_degrees) * beams > LEAST_DEGREES_VIEW_RAD and _is_possible(in_degrees, beams) else None
        )
        return Bearings(start, read, degrees or from_degrees if read else _impossible(step, beams))
    if _is_possible(in_degrees, beams) and _ends_at(start, in_degrees, beams, end):
        return Bearings(start, in_degrees, degrees or from_degrees)
    if not _is_possible(step, beams):
        if not _is_possible(spread, beams):
            return Bearings(start, None, _impossible(step, beams))
        instead = f"the beams are taken to lie evenly from angle_min {start:.3f} to angle_max {end:.3f}"
        return Bearings(start, spread, f"angle_increment {step:g} cannot be of {beams} beams: {instead}; {DRIVER}")
    last = start + (beams - 1) * step
    text = f"angle_max is {end:.3f}, but {beams} beams with an angle_increment of {step:.6g} end at {last:.3f}"
    return Bearings(start, step, text, spread if _is_possible(spread, beams) else None)


def _is_possible(step: float, beams: int) -> bool:
    """Whether `beams` with this step cover something, and no more than a turn."""
    if not math.isfinite(step):
        return False
    view = abs(step) * (beams - 1)
    return SMALLEST_VIEW_RAD <= view <= TURN_RAD + _spare_rad(step, beams)


def _ends_at(start: float, step: float, beams: int, end: float) -> bool:
    """Whether the last beam is at `end`, give or take some beams and whole turns."""
    return abs(wrap(start + (beams - 1) * step - end)) <= _spare_rad(step, beams)


def _spare_rad(step: float, beams: int) -> float:
    return max(SPARE_BEAMS, SPARE_SHARE * beams) * abs(step)


def _impossible(step: float, beams: int) -> str:
    view = "nothing" if not abs(step) * beams > SMALLEST_VIEW_RAD else f"{abs(step) * beams / TURN_RAD:.1f} turns"
    return f"angle_increment is {step:g}: {beams} beams would cover {view}; its scans are not used; {DRIVER}"


class BearingsCheck:
    """Checks the bearings of one laser's scans, and decides by walls where its numbers contradict each other."""

    def __init__(self) -> None:
        self._straighter: deque[bool] = deque(maxlen=2 * ENOUGH_WINDOWS)  # by the step that the message states
        self._scans = 0

    def check(self, scan: LaserScan) -> tuple[LaserScan | None, str]:
        """The scan with bearings that can be, and what is wrong, empty for a sound scan.

        None in place of the scan if there are no such bearings, or walls have still to tell which they are.
        """
        bearings = bearings_of(scan)
        if bearings.step is None:
            return None, bearings.fault
        step, fault = bearings.step, bearings.fault
        if fault and not bearings.other and fault.startswith("angle_max"):
            fault += f": angle_increment is believed; {DRIVER}"
        if bearings.other:
            self._compare(scan, bearings.start, bearings.step, bearings.other)
            chosen, why = self._choose(bearings.step, bearings.other)
            if chosen is None:
                return None, ""
            step, fault = chosen, f"{fault}: {why}; {DRIVER}"
        return replace(scan, angle_min=bearings.start, angle_increment=step), fault

    def _compare(self, scan: LaserScan, start: float, stated: float, other: float) -> None:
        self._scans = min(self._scans + 1, MOST_SCANS)
        if abs(abs(stated) - abs(other)) > 1e-9:  # of steps that are mirrored, both make walls straight
            difference = _thickness(scan, start, stated) - _thickness(scan, start, other)
            self._straighter.extend((difference < 0).tolist())

    def _choose(self, stated: float, other: float) -> tuple[float | None, str]:
        """The step to use and why; None while walls may tell later."""
        windows = len(self._straighter)
        share = sum(self._straighter) / windows if windows >= ENOUGH_WINDOWS else 0.5
        if share >= CLEAR_SHARE:
            return stated, "walls are straight by angle_increment, which is used"
        if share <= 1 - CLEAR_SHARE:
            return other, "walls are straight where the beams lie evenly up to angle_max, which is used"
        return (stated, "angle_increment is believed") if self._scans >= MOST_SCANS else (None, "")


def _thickness(scan: LaserScan, start: float, step: float) -> Floats:
    """(m,) how thick each stretch of wall in a scan is for its length, 0 for a straight one."""
    beams = len(scan.ranges)
    size = max(LEAST_WINDOW, beams // WINDOWS)
    if beams < size:
        return np.empty(0)
    ranges = scan.ranges[: beams // size * size].astype(np.float64).reshape(-1, size)
    with np.errstate(invalid="ignore"):
        joined = np.abs(np.diff(ranges, axis=1)) < LARGEST_STEP * ranges[:, 1:]
    walls = joined.all(axis=1) & (ranges > 0).all(axis=1) & np.isfinite(ranges).all(axis=1)
    angles = start + step * np.arange(ranges.size).reshape(-1, size)
    points = ranges[walls, :, None] * np.stack([np.cos(angles[walls]), np.sin(angles[walls])], axis=-1)
    centred = points - points.mean(axis=1, keepdims=True)
    across = np.linalg.eigvalsh(np.einsum("wij,wik->wjk", centred, centred))
    thickness: Floats = across[:, 0] / np.maximum(across[:, 1], 1e-12)
    return thickness
