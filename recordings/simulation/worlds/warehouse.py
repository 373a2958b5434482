"""A warehouse: twelve identical aisles of 40 m, 3 m apart, between racks with uprights and pallets, or closed ones."""

import numpy as np
from numpy.typing import NDArray

from wayfi.recordings.simulation.drive import RoutePlan, TrueMotion
from wayfi.recordings.simulation.radio import RadioPlan
from wayfi.recordings.simulation.surfaces import Surfaces, box, still

Floats = NDArray[np.float64]

AISLES = 12
SPACING_M = 3.0
SOUTH_M, NORTH_M = 0.0, 44.0
RACK_SOUTH_M, RACK_NORTH_M = 2.0, 42.0
RACK_DEPTH_M = 1.0
BAY_M = 2.5
UPRIGHT_M = 0.1
PALLET_SETBACK_M = 0.12
PALLET_WIDTH_M = 1.1
EMPTY_PLACES = 0.08
CLOSED_RACKS = (0.0, 0.5, 1.0)  # shares, of which a drive has one


def _aisle_x(aisle: int) -> float:
    """The x (m) of the middle of an aisle, counted from 1."""
    return SPACING_M * aisle


def _corners() -> Floats:
    order = [*range(1, AISLES + 1), 7, 4, 9, 6, 2, 11]
    corners = [(0.0, SOUTH_M)]
    for i, aisle in enumerate(order):
        ends = [(_aisle_x(aisle), SOUTH_M), (_aisle_x(aisle), NORTH_M)]
        corners += ends if i % 2 == 0 else ends[::-1]
    return np.array(corners)


ROUTE = RoutePlan(_corners(), length_m=800.0, duration_s=2050.0, wiggle_m=0.15)
RADIO = RadioPlan(inside=(-3.0, -3.0, 42.0, 47.0), inside_sites=9, margin_m=15.0, outside_sites=80, hotspots=6)


def surfaces(drive: TrueMotion, rng: np.random.Generator) -> Surfaces:  # noqa: ARG001 - every world has this signature
    """Outer walls, and racks on both sides of every aisle: open ones with pallets, and closed ones."""
    shell = box(-SPACING_M, SOUTH_M - 2.5, SPACING_M * (AISLES + 2), NORTH_M + 2.5)
    sides = [_aisle_x(side) + SPACING_M / 2 for side in range(AISLES + 1)]
    open_racks = [_rack(x, rng) for x in sides]
    closed = rng.random(len(sides)) < rng.choice(CLOSED_RACKS)
    racks = [_closed_rack(x) if shut else rack for x, rack, shut in zip(sides, open_racks, closed, strict=True)]
    return still(np.vstack([shell, *racks]))


def _closed_rack(x: float) -> Floats:
    """(4, 4) faces of a rack with a panel on each side: two walls, one depth of a rack apart."""
    half = RACK_DEPTH_M / 2
    return box(x - half, RACK_SOUTH_M, x + half, RACK_NORTH_M)


def _rack(x: float, rng: np.random.Generator) -> Floats:
    """(n, 4) faces of the rack centred at `x`: uprights on both sides, two pallets in each bay, some missing."""
    half, u = RACK_DEPTH_M / 2, UPRIGHT_M
    posts = [
        box(x + side * half - u / 2, y - u / 2, x + side * half + u / 2, y + u / 2)
        for y in np.arange(RACK_SOUTH_M, RACK_NORTH_M + 0.01, BAY_M)
        for side in (-1, 1)
    ]
    reach = half - PALLET_SETBACK_M
    places = [y + d for y in np.arange(RACK_SOUTH_M, RACK_NORTH_M - 0.01, BAY_M) for d in (0.1, 1.3)]
    pallets = [box(x - reach, y, x + reach, y + PALLET_WIDTH_M) for y in places if rng.random() >= EMPTY_PLACES]
    return np.vstack(posts + pallets)
