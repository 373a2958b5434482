"""What a stream of odometry says of the robot's motion."""

import math
from array import array
from collections import Counter
from dataclasses import dataclass

import numpy as np

from wayfi.frontends.frames.frame_tree import frame_name
from wayfi.frontends.measurements import SECOND_NS, Odometry

STILL_M, STILL_RAD = 1e-6, 1e-6  # between two messages: wheels that turn are seen to
LARGEST = 1e9  # m: larger numbers are no poses
USUAL = 99  # per cent of the speeds, so that a leap does not count as one


@dataclass(frozen=True, slots=True)
class OdometryInspection:
    """The path of the poses, m; speeds that 99 % of the steps do not exceed; the longest time without motion, s.

    `twist_path_m` is the path by the velocities. `child_frames` counts the messages of each frame whose pose is given,
    without a leading slash.
    """

    path_m: float
    top_speed_m_s: float
    top_turn_rad_s: float
    longest_still_s: float
    twist_path_m: float
    child_frames: dict[str, int]


class Motion:
    """Gathers the poses of one stream, of which the most frequent child frame counts."""

    def __init__(self) -> None:
        self._frames: Counter[str] = Counter()
        self._rows: dict[str, array[float]] = {}

    def add(self, m: Odometry) -> None:
        """Add a message."""
        frame = frame_name(m.child_frame_id)
        self._frames[frame] += 1
        speed = math.hypot(*m.twist[:2])
        row = (m.stamp_ns / SECOND_NS, m.pose.x, m.pose.y, m.pose.theta, speed)
        if all(abs(number) < LARGEST for number in row[1:]):
            self._rows.setdefault(frame, array("d")).extend(row)

    def inspection(self) -> OdometryInspection:
        """What the messages so far say."""
        frame = max(self._rows, key=lambda each: len(self._rows[each]), default="")
        rows = np.array(self._rows.get(frame, ()), np.float64).reshape(-1, 5)
        step_s = np.diff(rows[:, 0])
        rows, step_s = rows[np.r_[True, step_s > 0.0][: len(rows)]], step_s[step_s > 0.0]
        way_m = np.hypot(*np.diff(rows[:, 1:3], axis=0).T) if len(rows) > 1 else np.zeros(0)
        turn_rad = np.abs(np.arctan2(np.sin(turns := np.diff(rows[:, 3])), np.cos(turns)))
        seconds = np.minimum(step_s, 1.0)  # a longer step is a gap, over which the velocity is not known
        return OdometryInspection(
            path_m=float(way_m.sum()),
            top_speed_m_s=_usual(way_m, step_s),
            top_turn_rad_s=_usual(turn_rad, step_s),
            longest_still_s=_longest(step_s, (way_m < STILL_M) & (turn_rad < STILL_RAD)),
            twist_path_m=float((rows[1:, 4] * seconds).sum()),
            child_frames=dict(self._frames.most_common()),
        )


def _usual(ways: np.ndarray, step_s: np.ndarray) -> float:
    return float(np.percentile(ways / step_s, USUAL)) if len(ways) else 0.0


def _longest(step_s: np.ndarray, still: np.ndarray) -> float:
    """The longest time, s, over which every step was `still`."""
    longest = now = 0.0
    for seconds, stands in zip(step_s.tolist(), still.tolist(), strict=True):
        now = now + seconds if stands else 0.0
        longest = max(longest, now)
    return longest
