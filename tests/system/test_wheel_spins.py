"""A wheel spins in a smooth aisle, where no laser tells the way: a later closure bends the path there, by all of it."""

import math

import numpy as np
from legs import Leg, follow

from wayfi.backend.pose2 import Floats
from wayfi.recordings.simulation.surfaces import box, still

AISLE_M = 36.0  # between two rooms; the laser, which reaches 12 m, sees neither from its middle
SPIN = Leg(1.5, wheels=1.3)
IN_THE_ROOM = [
    Leg(3.0), Leg(turn=math.pi / 2), Leg(5.0), Leg(turn=math.pi / 2), Leg(3.0), SPIN, Leg(4.5),
    Leg(turn=math.pi / 2), Leg(2.5), Leg(turn=math.pi / 2),
]  # fmt: skip
THERE_AND_BACK = [Leg(26.5), SPIN, Leg(20.5), Leg(turn=math.pi), Leg(AISLE_M + 8.0)]


def two_rooms() -> Floats:
    """(n, 4) ends of the walls of two rooms, each with an open side, and of the smooth aisle between them."""
    rooms = [*box(-12.0, -4.0, 0.0, 4.0), *box(AISLE_M, -4.0, AISLE_M + 10.0, 4.0)]
    closed = [wall for wall in rooms if not (wall[0] == wall[2] and wall[0] in (0.0, AISLE_M))]
    sides = [[x, side, x, 4.0 * side] for x in (0.0, AISLE_M) for side in (-1.0, 1.0)]
    aisle = [[0.0, side, AISLE_M, side] for side in (-1.0, 1.0)]
    crates = [box(-7.0, -1.5, -6.0, -0.9), box(-3.0, 3.2, -2.2, 3.9), box(AISLE_M + 5.0, 1.0, AISLE_M + 6.0, 2.0)]
    return np.concatenate([closed, sides, aisle, *crates, box(AISLE_M + 3.0, -3.0, AISLE_M + 4.0, -2.0)])


def test_a_closure_corrects_the_steps_in_which_a_wheel_spun() -> None:
    driven = follow([*IN_THE_ROOM, *THERE_AND_BACK], still(two_rooms()))
    assert driven.worst_along_m() < 0.1  # of the 0.45 m that the wheels counted too much in the aisle
