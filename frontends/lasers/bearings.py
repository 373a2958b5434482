"""The bearings of a scan's beams: its numbers are checked against each other, and corrected where one is wrong.

A beam's bearing is `angle_min + i * angle_increment`; angle_max should be that of the last beam. Where it contradicts
by many beams, walls tell: they are straight by the right increment and bent by a wrong one.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.pose2 import Floats, wrap
from wayfi.frontends.measurements import LaserScan

TURN_RAD = 2 * math.pi
SPARE_BEAMS, SPARE_SHARE = 3.0, 0.02  # that angle_max may be off: drivers count a beam too many, or lose some of a turn
WHOLE_SHARE = 0.9  # of a turn, that counts as a whole one
LARGEST_RAD = 1.05 * TURN_RAD  # of a bearing: a larger number is in degrees
LARGEST_DEGREES = 1.05 * 360.0
SMALLEST_VIEW_RAD = 0.02  # of all beams together: less covers nothing
LEAST_DEGREES = 29.0  # from the first bearing to the last, 0.5 rad: less, read as degrees, is less than scanners see
LEAST_DEGREES_VIEW_RAD = 0.5  # more turns than one, read as degrees, are a narrower view than any scanner's
WINDOW_SHARE, LEAST_WINDOW = 5, 8  # a wall is looked for in a fifth of the beams, and 8: a smaller bend is not seen
WINDOW_STEPS = 4  # from one such window to the next one beside it
LARGEST_STEP = 0.15  # of the range, from one beam to the next on a wall
LARGEST_THICKNESS = 0.02  # of a wall by the better increment, in variance: more is no wall
ENOUGH_WALLS = 30  # a decision rests on; scans in rooms and halls were seen to have one to ten
CLEAR_SHARE = 0.6  # of the walls that one increment makes straighter; in real and simulated scans 0.64 to 1
MOST_SCANS = 40  # that the decision may take, 4 s at 10 Hz: then the walls do not tell
SAME_STEP = SPARE_SHARE  # relative: steps that differ by their sign alone
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
    if max(abs(start), abs(end or 0.0)) > LARGEST_RAD and _in_degrees(start, step, end, beams):
        degrees = f"angle_min {start:g} is in degrees: converted to radians; {DRIVER}"
        start, end = math.radians(start), None if end is None else math.radians(end)
    if beams < 2:
        return Bearings(start, step if math.isfinite(step) else 0.0, degrees)
    return _with_step(start, step, end, beams, degrees)


def _in_degrees(start: float, step: float, end: float | None, beams: int) -> bool:
    """Whether bearings that are large for radians are in degrees; radians may begin anywhere and go on for a turn."""
    if end is None:
        return True
    if abs(end - start) > LEAST_DEGREES:
        return True
    in_radians, in_degrees = (abs(start + k * (beams - 1) * step - end) for k in (1.0, math.degrees(1.0)))
    return not in_radians <= _spare_rad(step, beams) and in_degrees <= math.degrees(_spare_rad(step, beams))


def _with_step(start: float, step: float, end: float | None, beams: int, degrees: str) -> Bearings:
    """As `bearings_of`, for bearings in radians; `degrees` is what was wrong with their unit."""
    in_degrees, spread = math.radians(step), math.nan if end is None else (end - start) / (beams - 1)
    if _is_possible(step, beams) and (end is None or _ends_at(start, step, beams, end)):
        return Bearings(start, step, degrees)
    from_degrees = f"angle_increment {step:g} is in degrees: converted to radians; {DRIVER}"
    if end is None:
        if abs(in_degrees) * beams > LEAST_DEGREES_VIEW_RAD and _is_possible(in_degrees, beams):
            return Bearings(start, in_degrees, degrees or from_degrees)
        return Bearings(start, None, _impossible(step, beams))
    if _is_possible(in_degrees, beams) and _ends_at(start, in_degrees, beams, end):
        return Bearings(start, in_degrees, degrees or from_degrees)
    if not _is_possible(step, beams):
        if not _is_possible(spread, beams):
            return Bearings(start, None, _impossible(step, beams))
        instead = f"the beams are taken to lie evenly from angle_min {start:.3f} to angle_max {end:.3f}"
        return Bearings(start, spread, f"angle_increment {step:g} cannot be of {beams} beams: {instead}; {DRIVER}")
    last = start + (beams - 1) * step
    text = f"angle_max is {end:.3f}, but {beams} beams with an angle_increment of {step:.6g} end at {last:.3f}"
    if not _is_possible(spread, beams):
        return Bearings(start, step, f"{text}: angle_increment is believed; {DRIVER}")
    return Bearings(start, step, text, spread)


def _is_possible(step: float, beams: int) -> bool:
    """Whether `beams` with this step cover something, and no more than a turn."""
    if not math.isfinite(step):
        return False
    view = abs(step) * (beams - 1)
    return SMALLEST_VIEW_RAD <= view <= TURN_RAD + _spare_rad(step, beams)


def _ends_at(start: float, step: float, beams: int, end: float) -> bool:
    """Whether the last beam is at `end`, give or take some beams and whole turns.

    The last beam of a whole turn is near `end` whichever way it goes: the sign of the step decides.
    """
    backwards = (end - start) * step < 0 and abs(step) * beams > WHOLE_SHARE * TURN_RAD
    return not backwards and abs(wrap(start + (beams - 1) * step - end)) <= _spare_rad(step, beams)


def _spare_rad(step: float, beams: int) -> float:
    return max(SPARE_BEAMS, SPARE_SHARE * beams) * abs(step)


def _impossible(step: float, beams: int) -> str:
    view = "nothing" if not abs(step) * beams > SMALLEST_VIEW_RAD else f"{abs(step) * beams / TURN_RAD:.1f} turns"
    return f"angle_increment is {step:g}: {beams} beams would cover {view}; its scans are not used; {DRIVER}"


class BearingsCheck:
    """Checks the bearings of one laser's scans, and decides by walls, once, where its numbers contradict each other."""

    def __init__(self) -> None:
        self._straighter: list[bool] = []  # by the step that the message states
        self._scans = 0
        self._chosen: tuple[bool, str] | None = None  # whether it is the stated step, and why

    def check(self, scan: LaserScan) -> tuple[LaserScan | None, str]:
        """The scan with bearings that can be, and what is wrong, empty for a sound scan.

        None in place of the scan if there are no such bearings, or walls have still to tell which they are.
        """
        bearings = bearings_of(scan)
        if bearings.step is None:
            return None, bearings.fault
        if not bearings.other:
            if (bearings.start, bearings.step) != (scan.angle_min, scan.angle_increment):
                scan = replace(scan, angle_min=bearings.start, angle_increment=bearings.step)
            return scan, bearings.fault
        if self._chosen is None:
            self._compare(scan, bearings.start, bearings.step, bearings.other)
            self._choose()
        if self._chosen is None:
            return None, ""
        stated, why = self._chosen
        step = bearings.step if stated else bearings.other
        return replace(scan, angle_min=bearings.start, angle_increment=step), f"{bearings.fault}: {why}; {DRIVER}"

    def _compare(self, scan: LaserScan, start: float, stated: float, other: float) -> None:
        self._scans += 1
        if abs(abs(stated) - abs(other)) < SAME_STEP * abs(stated):
            self._scans = MOST_SCANS  # steps that mirror each other both make walls straight
            return
        (across, thickness), (others, other_thickness) = (_walls(scan, start, step) for step in (stated, other))
        clear = np.minimum(thickness, other_thickness) < LARGEST_THICKNESS
        self._straighter += (across < others)[clear].tolist()

    def _choose(self) -> None:
        """Choose a step, if walls tell by now, or so many scans were seen that they never will."""
        walls = len(self._straighter)
        share = sum(self._straighter) / walls if walls >= ENOUGH_WALLS else 0.5
        if share >= CLEAR_SHARE:
            self._chosen = True, "walls are straight by angle_increment, which is used"
        elif share <= 1 - CLEAR_SHARE:
            self._chosen = False, "walls are straight where the beams lie evenly up to angle_max, which is used"
        elif self._scans >= MOST_SCANS:
            self._chosen = True, "angle_increment is believed"


def _walls(scan: LaserScan, start: float, step: float) -> tuple[Floats, Floats]:
    """What may be walls of a scan: (m,) a measure of each one's thickness, and the thickness for its length.

    The measure changes least with the step where noise alone makes a wall thick.
    """
    beams = len(scan.ranges)
    size = max(LEAST_WINDOW, beams // WINDOW_SHARE)
    if beams < size:
        return np.empty(0), np.empty(0)
    windows = np.arange(size) + np.arange(0, beams - size + 1, size // WINDOW_STEPS)[:, None]
    ranges = scan.ranges[windows].astype(np.float64)
    with np.errstate(invalid="ignore"):
        joined = np.abs(np.diff(ranges, axis=1)) < LARGEST_STEP * ranges[:, 1:]
    found = joined.all(axis=1) & (ranges > 0).all(axis=1) & np.isfinite(ranges).all(axis=1)
    angles = start + step * windows[found]
    points = ranges[found, :, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    centred = points - points.mean(axis=1, keepdims=True)
    across, along = np.linalg.eigvalsh(np.einsum("wij,wik->wjk", centred, centred)).T
    along = np.maximum(along, np.finfo(np.float64).tiny)
    return across / np.sqrt(along), across / along
