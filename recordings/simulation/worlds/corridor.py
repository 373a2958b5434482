"""Long bare corridors: a straight one of 300 m, driven there and back, and a ring of 440 m, driven round and back.

Doors are flush with the walls, but for a niche every hundred metres or so. The laser, with a range of 6 m, sees two
parallel walls along most of the way; what the robot has driven along them only its wheels and WiFi know.
"""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wayfi.recordings.simulation.drive import RoutePlan, TrueMotion
from wayfi.recordings.simulation.laser import LaserSpec
from wayfi.recordings.simulation.radio import RadioPlan
from wayfi.recordings.simulation.surfaces import Surfaces, still
from wayfi.recordings.simulation.worlds.campus import walls

Floats = NDArray[np.float64]

WEST_M, EAST_M, RING_M = -20.0, 280.0, (150.0, 70.0)
HALF_WIDTH_M = 1.2
TURN_M = 0.3
BETWEEN_NICHES_M = (80.0, 140.0)
NICHE_DEPTH_M = 0.3
ACCESS_POINTS_EVERY_M = 25.0

# a spinning triangulation laser of the kind that small robots carry
LASER = LaserSpec(
    beams=360,
    angle_min=-math.pi,
    angle_increment=math.radians(1.0),
    range_min_m=0.15,
    range_max_m=6.0,
    period_ns=200_000_000,
    turn_s=0.2,
    reach_m=24.0,
)


def _route(corners: list[tuple[float, float]], length_m: float) -> RoutePlan:
    return RoutePlan(np.array(corners), length_m, duration_s=1.2 * length_m, wiggle_m=0.15, cruise_m_s=1.0)


def _ring(lap: int) -> list[tuple[float, float]]:
    """The corners of a lap from (0, 0) back to there, anticlockwise (1) or clockwise (-1)."""
    x, y = RING_M
    corners = [(x / 2, 0.0), (x / 2, y), (-x / 2, y), (-x / 2, 0.0)]
    return [*corners[::lap], (0.0, 0.0)]


def _turn(x: float, side: int) -> list[tuple[float, float]]:
    """The corners of a turn back at `x` m along the corridor, from one side of its middle to the other."""
    return [(x, -side * TURN_M), (x, side * TURN_M)]


_EAST_TURN, _WEST_TURN = _turn(EAST_M - 8.0, 1), _turn(WEST_M + 8.0, -1)  # the end walls are out of sight there
STRAIGHT_ROUTE = _route([(0.0, 0.0), (20.0, 0.0), *_EAST_TURN, *_WEST_TURN, *_EAST_TURN, *_WEST_TURN], length_m=1120.0)
RING_ROUTE = _route([(0.0, 0.0), *_ring(1), *_ring(1), *_turn(5.0, 1), *_ring(-1)], length_m=1300.0)


def _radio(low: tuple[float, float], high: tuple[float, float], access_points: Floats) -> RadioPlan:
    inside = (low[0], low[1], high[0], high[1])
    return RadioPlan(inside, 0, margin_m=10.0, outside_sites=0, hotspots=4, corridor_xy=tuple(access_points.tolist()))


def _ceiling(start: tuple[float, float], end: tuple[float, float]) -> Floats:
    """(k, 2) positions (m) of access points along a corridor's middle line."""
    steps = np.arange(5.0, math.dist(start, end), ACCESS_POINTS_EVERY_M) / math.dist(start, end)
    along: Floats = np.array(start) + steps[:, None] * (np.array(end) - np.array(start))
    return along


def _ring_ceiling() -> Floats:
    x, y = RING_M
    corners = [(-x / 2, 0.0), (x / 2, 0.0), (x / 2, y), (-x / 2, y), (-x / 2, 0.0)]
    return np.vstack([_ceiling(start, end) for start, end in pairwise(corners)])


STRAIGHT_RADIO = _radio((WEST_M, -1.0), (EAST_M, 1.0), _ceiling((WEST_M, 0.5), (EAST_M, 0.5)))
RING_RADIO = _radio((-RING_M[0] / 2, 0.0), (RING_M[0] / 2, RING_M[1]), _ring_ceiling())


def straight_surfaces(drive: TrueMotion, rng: np.random.Generator) -> Surfaces:  # noqa: ARG001 - as of every world
    """The walls of the straight corridor."""
    h = HALF_WIDTH_M
    return still(walls((WEST_M, -h), (EAST_M, h), NICHE_DEPTH_M, BETWEEN_NICHES_M, rng))


def ring_surfaces(drive: TrueMotion, rng: np.random.Generator) -> Surfaces:  # noqa: ARG001 - as of every world
    """The outer wall of the ring, and the wall around the block inside."""
    h, (x, y) = HALF_WIDTH_M, RING_M
    outside = walls((-x / 2 - h, -h), (x / 2 + h, y + h), NICHE_DEPTH_M, BETWEEN_NICHES_M, rng)
    block = walls((-x / 2 + h, h), (x / 2 - h, y - h), -NICHE_DEPTH_M, BETWEEN_NICHES_M, rng)
    return still(np.vstack([outside, block]))
