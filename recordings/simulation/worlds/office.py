"""An office floor: two adjoining rings of look-alike corridors, 60 x 40 m, with the same door niche every 4 m."""

import numpy as np
from numpy.typing import NDArray

from wayfi.recordings.simulation.drive import RoutePlan, TrueMotion
from wayfi.recordings.simulation.radio import RadioPlan
from wayfi.recordings.simulation.surfaces import Surfaces, polygon, still

Floats = NDArray[np.float64]

WEST_M, MIDDLE_M, EAST_M, SOUTH_M, NORTH_M = -10.0, 20.0, 50.0, 0.0, 40.0
HALF_WIDTH_M = 1.1
DOOR_SPACING_M = 4.0
DOOR_WIDTH_M = 0.9
DOOR_DEPTH_M = 0.15


def _corners() -> Floats:
    w, m, e, s, n = WEST_M, MIDDLE_M, EAST_M, SOUTH_M, NORTH_M
    lap = [(0.0, s), (e, s), (e, n), (w, n), (w, s)]
    east_ring = [(m, s), (m, n), (e, n), (e, s)]
    lap_back = [(w, s), (w, n), (e, n), (e, s)]
    west_ring_back = [(w, s), (w, n), (m, n), (m, s), (w, s), (w, n)]
    return np.array(lap + east_ring + lap_back + west_ring_back, dtype=float)


ROUTE = RoutePlan(_corners(), length_m=720.0, duration_s=1730.0, wiggle_m=0.15)
RADIO = RadioPlan(inside=(-12.0, -2.0, 52.0, 42.0), inside_sites=9, margin_m=8.0, outside_sites=44, hotspots=6)


def surfaces(drive: TrueMotion, rng: np.random.Generator) -> Surfaces:  # noqa: ARG001 - every world has this signature
    """The walls of the corridors, the same in every drive."""
    h = HALF_WIDTH_M
    outside = _walls(WEST_M - h, SOUTH_M - h, EAST_M + h, NORTH_M + h, DOOR_DEPTH_M)
    west_block = _walls(WEST_M + h, SOUTH_M + h, MIDDLE_M - h, NORTH_M - h, -DOOR_DEPTH_M)
    east_block = _walls(MIDDLE_M + h, SOUTH_M + h, EAST_M - h, NORTH_M - h, -DOOR_DEPTH_M)
    return still(np.vstack([outside, west_block, east_block]))


def _walls(x_min: float, y_min: float, x_max: float, y_max: float, niche_m: float) -> Floats:
    """(n, 4) faces of a rectangle with door niches `niche_m` deep, positive outwards."""
    corners = np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]])
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return polygon(np.vstack([_side(start, end, niche_m) for start, end in sides]))


def _side(start: Floats, end: Floats, niche_m: float) -> Floats:
    """(n, 2) corners (m) from `start` to `end`, without `end`; doors are evenly spaced around the middle."""
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    outwards = np.array([along[1], -along[0]])
    doors = int(length // DOOR_SPACING_M)
    centres = length / 2 + DOOR_SPACING_M * (np.arange(doors) - (doors - 1) / 2)
    offsets = np.array([[-0.5, 0.0], [-0.5, 1.0], [0.5, 1.0], [0.5, 0.0]]) * [DOOR_WIDTH_M, niche_m]
    niches = [start + (c + d) * along + depth * outwards for c in centres for d, depth in offsets]
    return np.vstack([start, *niches])
