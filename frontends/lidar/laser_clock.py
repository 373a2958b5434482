"""Finds the offset of the laser's clock from the odometry's, by the turns of the robot that both measure.

Scan matching sees the robot turn at the laser's stamps, the wheels at the odometry's. With stamps of one clock no
offset makes the two agree better. With stamps of two, the right offset lowers the mean squared error a hundredfold in
simulated drives, tenfold in real ones of poor odometry.
"""

from collections import deque

import numpy as np

from wayfi.backend.pose2 import Floats, wrap
from wayfi.frontends.lidar.lidar_config import LaserClockConfig
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.driven_path import DrivenPath


class LaserClock:
    """Compares turns by scan matching with those of the wheels, over offsets of the laser's stamps.

    A turn waits until the odometry has come `max_offset_s` further; the last `max_turns` are compared together.
    """

    def __init__(self, config: LaserClockConfig) -> None:
        self._config = config
        steps = round(config.max_offset_s / config.step_s)
        self._offsets_s: Floats = config.step_s * np.arange(-steps, steps + 1, dtype=np.float64)
        self._waiting: deque[tuple[int, int, float]] = deque()
        self._squared_errors: deque[Floats] = deque(maxlen=config.max_turns)

    def add_turn(self, from_ns: int, to_ns: int, turned_rad: float) -> None:
        """Add the turn that scan matching found between two stamps of the laser."""
        if abs(turned_rad) >= self._config.min_turn_rad:
            self._waiting.append((from_ns, to_ns, turned_rad))

    def offset_s(self, path: DrivenPath) -> float | None:
        """What is to be added to the laser's stamps, s; None while they may be the odometry's."""
        config, latest = self._config, path.latest
        ahead_ns = round(config.max_offset_s * SECOND_NS)
        while latest and self._waiting and self._waiting[0][1] + ahead_ns <= latest.stamp_ns:
            self._compare(*self._waiting.popleft(), path)
        if len(self._squared_errors) < config.min_turns:
            return None
        mean = np.mean(self._squared_errors, axis=0)
        best = int(mean.argmin())
        without = float(mean[len(mean) // 2])
        at_the_edge = best in (0, len(mean) - 1)
        if at_the_edge or without < config.good_error_rad**2 or without < config.min_gain * mean[best]:
            return None
        squares = np.array(self._squared_errors)
        agreement = float(np.mean(squares[:, best] <= squares[:, len(mean) // 2]))
        if agreement < config.min_agreement:
            return None
        return float(self._offsets_s[best] + _vertex(*mean[best - 1 : best + 2]) * config.step_s)

    def _compare(self, from_ns: int, to_ns: int, turned_rad: float, path: DrivenPath) -> None:
        """Note a turn's squared error at each offset; nothing where the path is not kept that far back."""
        turns = []
        for offset_s in self._offsets_s.tolist():
            shift_ns = round(offset_s * SECOND_NS)
            begin, end = path.at(from_ns + shift_ns), path.at(to_ns + shift_ns)
            if begin is None or end is None:
                return
            turns.append(wrap(end.T_path_base.theta - begin.T_path_base.theta))
        errors = np.minimum(np.abs(turned_rad - np.array(turns)), self._config.max_error_rad)
        self._squared_errors.append(errors**2)


def _vertex(before: float, lowest: float, after: float) -> float:
    """Where the parabola through three values has its vertex, in steps from the middle one, which is the lowest."""
    return 0.5 * (before - after) / (before - 2 * lowest + after)
