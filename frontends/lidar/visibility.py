"""Whether a scan contradicts the map: beams that pass through walls which the map says are there.

A wall that is hidden, or out of the scan's view, says nothing. So people around the robot, or a room that is new, make
no contradiction; a robot that was carried elsewhere does.
"""

import math

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.scan_points import ScanPoints

BESIDE_RAD = 0.1  # between two beams that see one direction: points are thinned to 6 cm of wall, 0.1 rad at 0.6 m
MARGIN_M = 0.3  # in range: what a pose off by some centimetres and a slanting wall leave
LEAST_IN_VIEW = 20  # points of the map; fewer are no evidence


def seen_through_share(scan: ScanPoints, walls: Floats, T_walls_base: Pose2) -> float:
    """The share, 0 to 1, of `walls` (n, 2) m in the view of a scan taken at `T_walls_base` that its beams pass through.

    0.0 where fewer than LEAST_IN_VIEW are in view.
    """
    T_laser_walls = (T_walls_base @ scan.T_base_laser).inverse()
    bearings, ranges = _polar(scan.T_base_laser.inverse().transform(scan.points))
    order = np.argsort(bearings)
    bearings, ranges = _closed(bearings[order], ranges[order])
    wall_bearings, wall_ranges = _polar(T_laser_walls.transform(walls))
    after = np.clip(np.searchsorted(bearings, wall_bearings), 1, len(bearings) - 1)
    beside = bearings[after] - bearings[after - 1] < BESIDE_RAD
    nearest = np.minimum(ranges[after], ranges[after - 1])
    furthest = np.maximum(ranges[after], ranges[after - 1])
    through = beside & (wall_ranges < nearest - MARGIN_M)
    met = beside & ~through & (wall_ranges < furthest + MARGIN_M)
    in_view = int(through.sum() + met.sum())
    return float(through.sum()) / in_view if in_view >= LEAST_IN_VIEW else 0.0


def _polar(points: Floats) -> tuple[Floats, Floats]:
    """(n,) bearings (rad) and ranges (m) of points (n, 2) m."""
    return np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])


def _closed(bearings: Floats, ranges: Floats) -> tuple[Floats, Floats]:
    """Sorted bearings with the last one before and the first one after them, a turn away."""
    turn = 2 * math.pi
    return np.r_[bearings[-1] - turn, bearings, bearings[0] + turn], np.r_[ranges[-1], ranges, ranges[0]]
