"""A campus: rings of long bare corridors on one floor, 260 x 110 m, with some door niches.

The laser has a range of 8 m and a field of view of 180 degrees; along most of the route it sees two straight walls.
"""

import math

import numpy as np
from numpy.typing import NDArray

from wayfi.recordings.simulation.drive import RoutePlan, TrueMotion
from wayfi.recordings.simulation.laser import LaserSpec
from wayfi.recordings.simulation.radio import RadioPlan
from wayfi.recordings.simulation.surfaces import Surfaces, polygon, still

Floats = NDArray[np.float64]

COLUMNS_M, COLUMN_HALF_WIDTHS_M = (-20.0, 110.0, 240.0), (1.2, 1.0, 1.3)
ROWS_M, ROW_HALF_WIDTHS_M = (0.0, 55.0, 110.0), (1.5, 1.1, 1.25)
BETWEEN_DOORS_M = (15.0, 45.0)
DOOR_WIDTH_M = 1.0
DOOR_DEPTH_M = 0.3
ACCESS_POINTS_EVERY_M = 25.0

# SICK LMS 200 in its millimetre mode, reduced to two scans a second
LASER = LaserSpec(
    beams=180,
    angle_min=math.radians(-89.5),
    angle_increment=math.radians(1.0),
    range_min_m=0.1,
    range_max_m=8.0,
    period_ns=500_000_000,
    turn_s=1 / 75,
    reach_m=32.0,
)


def _corners() -> Floats:
    (w, m, e), (s, c, n) = COLUMNS_M, ROWS_M
    around = [(0.0, s), (e, s), (e, n), (w, n), (w, s)]
    south_east_ring = [(m, s), (m, c), (e, c), (e, s)]
    west_rings = [(m, s), (m, n), (w, n), (w, c)]
    back = [(e, c), (e, n), (m, n), (m, s), (w, s)]
    return np.array(around + south_east_ring + west_rings + back)


def _access_points() -> tuple[tuple[float, float], ...]:
    """Positions (m) at the ceiling of every corridor, alternately left and right of its middle."""
    west_east, south_north = (np.arange(line[0] + 5.0, line[-1], ACCESS_POINTS_EVERY_M) for line in (COLUMNS_M, ROWS_M))
    rows = [(x, y + (-1) ** k * 0.8) for y in ROWS_M for k, x in enumerate(west_east.tolist())]
    columns = [(x + (-1) ** k * 0.8, y) for x in COLUMNS_M for k, y in enumerate(south_north.tolist())]
    return tuple(rows + columns)


ROUTE = RoutePlan(_corners(), length_m=2150.0, duration_s=2580.0, wiggle_m=0.15, cruise_m_s=1.0)
RADIO = RadioPlan(
    inside=(COLUMNS_M[0], ROWS_M[0], COLUMNS_M[-1], ROWS_M[-1]),
    inside_sites=0,
    margin_m=10.0,
    outside_sites=0,
    hotspots=6,
    corridor_xy=_access_points(),
)


def surfaces(drive: TrueMotion, rng: np.random.Generator) -> Surfaces:  # noqa: ARG001 - every world has this signature
    """The walls of the corridors: the outer wall, and one around each block between corridors."""
    (w, _, e), (s, _, n) = COLUMNS_M, ROWS_M
    to_w, to_e = COLUMN_HALF_WIDTHS_M[0], COLUMN_HALF_WIDTHS_M[-1]
    to_s, to_n = ROW_HALF_WIDTHS_M[0], ROW_HALF_WIDTHS_M[-1]
    outside = walls((w - to_w, s - to_s), (e + to_e, n + to_n), DOOR_DEPTH_M, BETWEEN_DOORS_M, rng)
    blocks = [_block(column, row, rng) for column in range(len(COLUMNS_M) - 1) for row in range(len(ROWS_M) - 1)]
    return still(np.vstack([outside, *blocks]))


def _block(column: int, row: int, rng: np.random.Generator) -> Floats:
    """(n, 4) faces of the block between two columns and two rows of corridors."""
    low = (COLUMNS_M[column] + COLUMN_HALF_WIDTHS_M[column], ROWS_M[row] + ROW_HALF_WIDTHS_M[row])
    column, row = column + 1, row + 1
    high = (COLUMNS_M[column] - COLUMN_HALF_WIDTHS_M[column], ROWS_M[row] - ROW_HALF_WIDTHS_M[row])
    return walls(low, high, -DOOR_DEPTH_M, BETWEEN_DOORS_M, rng)


def walls(
    low: tuple[float, float],
    high: tuple[float, float],
    niche_m: float,
    between_m: tuple[float, float],
    rng: np.random.Generator,
) -> Floats:
    """(n, 4) faces of the rectangle from `low` to `high` (m), with door niches `niche_m` deep, positive outwards.

    Along each side the niches are `between_m` apart, drawn at random.
    """
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return polygon(np.vstack([_side(start, end, niche_m, between_m, rng) for start, end in sides]))


def _side(
    start: Floats, end: Floats, niche_m: float, between_m: tuple[float, float], rng: np.random.Generator
) -> Floats:
    """(n, 2) corners (m) from `start` to `end`, without `end`."""
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    outwards = np.array([along[1], -along[0]])
    doors = rng.uniform(*between_m, int(length // between_m[0])).cumsum()
    offsets = np.array([[-0.5, 0.0], [-0.5, 1.0], [0.5, 1.0], [0.5, 0.0]]) * [DOOR_WIDTH_M, niche_m]
    niches = [
        start + (door + d) * along + depth * outwards for door in doors[doors < length - 3.0] for d, depth in offsets
    ]
    return np.vstack([start, *niches])
