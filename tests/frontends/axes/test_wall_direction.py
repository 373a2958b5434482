"""The direction of most walls that a scan sees, whatever else stands there."""

import math

import numpy as np
import pytest

from wayfi.backend.pose2 import Floats
from wayfi.frontends.axes.wall_direction import QUARTER, quarter, wall_direction


def normals_of(angles: Floats) -> Floats:
    """Unit normals (n, 2) at angles (n,) rad."""
    return np.column_stack([np.cos(angles), np.sin(angles)])


@pytest.mark.parametrize("heading", [0.0, 0.01, 0.4, math.pi / 4, 1.2, -2.0])
def test_four_walls_tell_the_heading_to_a_milliradian_beside_furniture(heading: float) -> None:
    rng = np.random.default_rng(1)
    walls = heading + QUARTER * rng.integers(0, 4, 400) + rng.normal(0.0, 0.02, 400)
    furniture = rng.uniform(-math.pi, math.pi, 150)
    seen = wall_direction(X, normals_of(np.concatenate([walls, furniture])))
    assert seen is not None
    assert quarter(seen.angle - heading) == pytest.approx(0.0, abs=3e-3)
    assert 0 <= seen.angle < QUARTER
    assert seen.share == pytest.approx(0.75, abs=0.05)
    assert seen.points == pytest.approx(seen.share * 550)


def test_what_stands_anyhow_has_no_share() -> None:
    seen = wall_direction(X, normals_of(np.random.default_rng(2).uniform(-math.pi, math.pi, 2000)))
    assert seen is not None
    assert seen.share < 0.12


def test_walls_at_an_angle_do_not_draw_those_along_the_axes() -> None:
    seen = wall_direction(X, normals_of(np.concatenate([np.full(200, 0.3), np.full(120, 0.3 + 0.06)])))
    assert seen is not None
    assert seen.angle == pytest.approx(0.3, abs=1e-6)


def test_unknown_normals_tell_nothing() -> None:
    assert wall_direction(np.full((50, 2), np.nan)) is None
    assert wall_direction(np.empty((0, 2))) is None
