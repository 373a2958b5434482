"""Whether the laser's clock is the odometry's: then scan matching sees the robot turn when its wheels turn it.

Turns tell it well: with sound stamps no offset fits them better, with wrong ones the right offset fits a hundred times
better (squared residual, simulated drives; ten times on real ones of poor odometry).
"""

from collections import deque

import numpy as np

from wayfi.backend.pose2 import Floats, wrap
from wayfi.frontends.odometry.driven_path import DrivenPath

SECOND_NS = 1_000_000_000
REACH_S = 3.0
STEP_S = 0.1
OFFSETS_S = np.arange(-REACH_S, REACH_S + STEP_S / 2, STEP_S)  # what is added to a laser's stamp
TURN_RAD = 0.1  # less tells nothing of when
CAP_RAD = 0.3  # a match that failed counts no more than this
LEAST, WINDOW = 6, 40  # turns that are compared
BETTER = 6.0  # times smaller squared residual than without offset; sound recordings were seen to have 2.7
OFF_RAD = 0.05  # residual of stamps as they are, below which they are good enough


class LaserClock:
    """Compares the turns that scan matching saw with those of the wheels, over offsets of the laser's stamps.

    A turn waits until the wheels have come `REACH_S` further; the last `WINDOW` of them are judged together.
    """

    def __init__(self) -> None:
        self._waiting: deque[tuple[int, int, float]] = deque()
        self._squares: deque[Floats] = deque(maxlen=WINDOW)

    def add(self, from_ns: int, to_ns: int, turned_rad: float) -> None:
        """Scan matching saw the robot turn so far between two stamps."""
        if abs(turned_rad) >= TURN_RAD:
            self._waiting.append((from_ns, to_ns, turned_rad))

    def offset_s(self, path: DrivenPath) -> float | None:
        """What is to be added to the laser's stamps; None while nothing speaks against them."""
        latest = path.latest
        while latest and self._waiting and self._waiting[0][1] + REACH_S * SECOND_NS <= latest.stamp_ns:
            self._compare(*self._waiting.popleft(), path)
        if len(self._squares) < LEAST:
            return None
        mean = np.mean(self._squares, axis=0)
        best = int(mean.argmin())
        now = float(mean[len(OFFSETS_S) // 2])
        at_the_edge = best in (0, len(mean) - 1)
        if at_the_edge or now < OFF_RAD**2 or now < BETTER * mean[best]:
            return None
        return float(OFFSETS_S[best] + _vertex(*mean[best - 1 : best + 2]) * STEP_S)

    def _compare(self, from_ns: int, to_ns: int, turned_rad: float, path: DrivenPath) -> None:
        turns = []
        for offset_s in OFFSETS_S:
            shift_ns = round(float(offset_s) * SECOND_NS)
            begin, end = path.at(from_ns + shift_ns), path.at(to_ns + shift_ns)
            if begin is None or end is None:
                return
            turns.append(wrap(end.T_path_base.theta - begin.T_path_base.theta))
        self._squares.append(np.minimum(np.abs(turned_rad - np.array(turns)), CAP_RAD) ** 2)


def _vertex(before: float, least: float, after: float) -> float:
    """Where the parabola through three values has its vertex, in steps from the middle one, which is the least."""
    return 0.5 * (before - after) / (before - 2 * least + after)
