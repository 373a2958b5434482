"""Finds the offset of the laser's clock from the odometry's, by the turns of the robot that both measure.

Scan matching sees the robot turn at the laser's stamps, the wheels at the odometry's. With stamps of one clock no
offset makes the two agree better. With stamps of two, the right offset lowers the mean squared error a hundredfold in
simulated drives, tenfold in real ones of poor odometry.
"""

from collections import deque

import numpy as np

from wayfi.backend.pose2 import Floats, wrap_all
from wayfi.frontends.lidar.laser_latency import Turn, latency_s, vertex
from wayfi.frontends.lidar.lidar_config import LaserClockConfig
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.driven_path import DrivenPath


class LaserClock:
    """Compares turns by scan matching with those of the wheels, over offsets of the laser's stamps.

    A turn waits until the odometry has come `max_offset_s` further; the last ones are compared together.
    """

    def __init__(self, config: LaserClockConfig) -> None:
        self._config = config
        steps = round(config.max_offset_s / config.step_s)
        self._offsets_s: Floats = config.step_s * np.arange(-steps, steps + 1, dtype=np.float64)
        self._shifts_ns = np.array([round(offset_s * SECOND_NS) for offset_s in self._offsets_s.tolist()], np.int64)
        self._waiting: deque[tuple[int, int, float]] = deque()
        self._turns: deque[Turn] = deque(maxlen=config.latency.max_turns)
        self._compared = 0

    def add_turn(self, from_ns: int, to_ns: int, turned_rad: float) -> None:
        """Add the turn that scan matching found between two stamps of the laser."""
        if abs(turned_rad) >= self._config.min_turn_rad:
            self._waiting.append((from_ns, to_ns, turned_rad))

    def offset_s(self, path: DrivenPath) -> float | None:
        """What is to be added to the laser's stamps, s; None while they may be the odometry's."""
        config, latest, compared = self._config, path.latest, self._compared
        ahead_ns = round(config.max_offset_s * SECOND_NS)
        while latest and self._waiting and self._waiting[0][1] + ahead_ns <= latest.stamp_ns:
            self._compare(*self._waiting.popleft(), path)
        if self._compared == compared:
            return None
        offset_s = self._clock_offset_s()
        if offset_s is None and self._compared % config.latency.every_turns == 0:
            offset_s = latency_s(list(self._turns), self._offsets_s, config.latency)
        return offset_s

    def _clock_offset_s(self) -> float | None:
        """The offset at which the newest turns fit many times better than without one; None if there is none."""
        config = self._config
        if len(self._turns) < config.min_turns:
            return None
        newest = list(self._turns)[-config.max_turns :]
        errors = np.array([np.abs(turn.by_laser - turn.by_wheels) for turn in newest])
        squares = np.minimum(errors, config.max_error_rad) ** 2
        mean = squares.mean(axis=0)
        best, middle = int(mean.argmin()), len(mean) // 2
        at_the_edge = best in (0, len(mean) - 1)
        if at_the_edge or mean[middle] < config.good_error_rad**2 or mean[middle] < config.min_gain * mean[best]:
            return None
        agreement = float(np.mean(squares[:, best] <= squares[:, middle]))
        if agreement < config.min_agreement:
            return None
        return float(self._offsets_s[best] + vertex(*mean[best - 1 : best + 2]) * config.step_s)

    def _compare(self, from_ns: int, to_ns: int, turned_rad: float, path: DrivenPath) -> None:
        """Note what the wheels say of a turn at each offset.

        Nothing where the path is not kept that far back, or where the laser led, which agrees with itself as it is.
        """
        moments_ns = np.concatenate([from_ns + self._shifts_ns, to_ns + self._shifts_ns])
        earliest, begin, end, latest = (path.at(int(t)) for t in (moments_ns[0], from_ns, to_ns, moments_ns[-1]))
        if earliest is None or begin is None or end is None or latest is None or latest.led_s > earliest.led_s:
            return
        begins, ends = np.split(path.headings_at(moments_ns), 2)
        self._turns.append(Turn(turned_rad, wrap_all(ends - begins), end.path_m - begin.path_m))
        self._compared += 1
