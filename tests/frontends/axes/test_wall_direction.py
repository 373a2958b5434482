"""The direction of most walls that a scan sees, whatever else stands there."""

import math

import numpy as np
import pytest

from wayfi.backend.pose2 import Floats
from wayfi.frontends.axes.wall_direction import QUARTER, quarter, wall_direction


def room_of(direction: float, offs: Floats, furniture: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Points (n, 2) m of the four walls of a room, 12 m wide, with normals that are `offs` rad off, then furniture."""
    sides = rng.integers(0, 4, len(offs))
    points = turned(QUARTER * sides, np.column_stack([np.full(len(offs), 6.0), rng.uniform(-6.0, 6.0, len(offs))]))
    angles = np.concatenate([direction + QUARTER * sides + offs, rng.uniform(-math.pi, math.pi, furniture)])
    standing = np.concatenate([turned(direction, points), rng.uniform(-5.0, 5.0, (furniture, 2))])
    return standing, np.column_stack([np.cos(angles), np.sin(angles)])


def turned(by: Floats | float, points: Floats) -> Floats:
    """Points (n, 2), or each of them, turned by rad."""
    c, s = np.cos(by), np.sin(by)
    return np.column_stack([c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1]])


@pytest.mark.parametrize("heading", [0.0, 0.01, 0.4, math.pi / 4, 1.2, -2.0])
def test_four_walls_tell_the_heading_to_a_milliradian_beside_furniture(heading: float) -> None:
    rng = np.random.default_rng(1)
    seen = wall_direction(*room_of(heading, rng.normal(0.0, 0.03, 400), 150, rng))
    assert seen is not None
    assert quarter(seen.angle - heading) == pytest.approx(0.0, abs=1e-3)
    assert 0 <= seen.angle < QUARTER
    assert seen.share == pytest.approx(0.7, abs=0.05)
    assert seen.points == pytest.approx(seen.share * 550)


def test_a_row_of_parked_cars_tells_the_direction_in_which_it_stands() -> None:
    """Twelve fronts in line, that stand three degrees askew to one side, and the wall beyond: normals would tell 2."""
    rng = np.random.default_rng(4)
    askew, across = rng.normal(0.05, 0.02, 12), np.linspace(-0.9, 0.9, 30)
    front = np.column_stack([across, np.zeros(30)])
    cars = [turned(a, front) + np.array([2.7 * k - 15.0, 3.0]) for k, a in enumerate(askew)]
    wall = np.column_stack([np.linspace(-15.0, 15.0, 150), np.full(150, 8.0)])
    angles = math.pi / 2 + np.concatenate([np.repeat(askew, 30), np.zeros(150)])
    points, normals = np.concatenate([*cars, wall]), np.column_stack([np.cos(angles), np.sin(angles)])
    seen = wall_direction(turned(0.3, points), turned(0.3, normals))
    assert seen is not None
    assert quarter(seen.angle - 0.3) == pytest.approx(0.0, abs=2e-3)


def test_what_stands_anyhow_has_no_share() -> None:
    seen = wall_direction(*room_of(0.0, np.empty(0), 2000, np.random.default_rng(2)))
    assert seen is not None
    assert seen.share < 0.12


def test_walls_at_an_angle_do_not_draw_those_along_the_axes() -> None:
    rng = np.random.default_rng(3)
    walls, others = (room_of(direction, np.zeros(n), 0, rng) for direction, n in ((0.3, 200), (0.36, 120)))
    seen = wall_direction(*(np.concatenate(pair) for pair in zip(walls, others, strict=True)))
    assert seen is not None
    assert seen.angle == pytest.approx(0.3, abs=1e-3)


def test_unknown_normals_tell_nothing() -> None:
    assert wall_direction(np.zeros((50, 2)), np.full((50, 2), np.nan)) is None
    assert wall_direction(np.empty((0, 2)), np.empty((0, 2))) is None
