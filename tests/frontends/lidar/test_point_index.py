"""The index finds the nearest point within the gate, as a search of all points does."""

import numpy as np
import pytest

from wayfi.frontends.lidar.point_index import build_index, nearest

CELL_M = 0.5
RNG = np.random.default_rng(5)
POINTS = RNG.uniform(-6.0, 6.0, (400, 2))
AT = RNG.uniform(-8.0, 8.0, (400, 2))


@pytest.mark.parametrize("gate_m", [0.05, 0.2, 0.35, CELL_M])
def test_no_point_within_the_gate_is_missed(gate_m: float) -> None:
    index = build_index(POINTS, np.zeros_like(POINTS), CELL_M)
    found = [nearest(x, y, gate_m, index.points, index.cells) for x, y in AT]
    away_m = np.hypot(*(index.points[None] - AT[:, None]).transpose(2, 0, 1))
    expected = np.where(away_m.min(axis=1) < gate_m, away_m.argmin(axis=1), -1)
    assert found == expected.tolist()


def test_a_point_on_the_edge_of_a_cell_is_found_from_the_next() -> None:
    index = build_index(np.array([[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]]), np.zeros((3, 2)), CELL_M)
    assert nearest(0.9, 1.1, 0.15, index.points, index.cells) == 1
    assert nearest(0.9, 1.1, 0.14, index.points, index.cells) == -1
