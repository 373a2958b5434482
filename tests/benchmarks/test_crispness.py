"""The area that hits fill tells doubled walls from single ones."""

import numpy as np
import pytest
from benchmarks.crispness import CELL_M, placed, wall_area_m2
from rooms import HALL, see

from wayfi.backend.pose2 import Floats, Pose2

PASSES = np.array([[-3.0, -2.0, 0.0], [-1.0, -2.0, 0.0], [1.0, -2.5, 0.0], [3.0, -2.0, 3.0], [0.0, -2.0, 3.0]])


def hall_from(poses: Floats) -> Floats:
    """What is seen of a hall from PASSES, placed at `poses`."""
    rng = np.random.default_rng(0)
    scans = {k: see(HALL, Pose2.of(pose), rng).points for k, pose in enumerate(PASSES)}
    return placed(scans, poses)


def test_one_wall_drawn_twice_fills_twice_the_area() -> None:
    wall = np.column_stack([np.linspace(0, 10, 5000), np.full(5000, 0.5 * CELL_M)])
    assert wall_area_m2(wall) == pytest.approx(10 * CELL_M, rel=0.02)
    assert wall_area_m2(np.concatenate([wall, wall + np.array([0.0, 0.3])])) == pytest.approx(2 * wall_area_m2(wall))


def test_a_stray_hit_counts_little() -> None:
    wall = np.column_stack([np.linspace(0, 10, 5000), np.full(5000, 0.5 * CELL_M)])
    stray = np.random.default_rng(0).uniform(-50, 50, (5, 2))
    assert wall_area_m2(np.concatenate([wall, stray])) < wall_area_m2(wall) + 5 * CELL_M**2


@pytest.mark.parametrize("off_m", [0.1, 0.3, 1.0])
def test_the_way_back_in_another_place_blurs_the_map(off_m: float) -> None:
    moved = PASSES + np.array([0.0, off_m, 0.0]) * (PASSES[:, 2:] > 0)
    assert wall_area_m2(hall_from(moved)) > 1.15 * wall_area_m2(hall_from(PASSES))


@pytest.mark.parametrize("seed", range(3))
def test_drift_of_the_heading_blurs_the_map(seed: int) -> None:
    drift = np.zeros_like(PASSES)
    drift[:, 2] = np.cumsum(0.05 * np.random.default_rng(seed).standard_normal(len(PASSES)))
    assert wall_area_m2(hall_from(PASSES + drift)) > 1.15 * wall_area_m2(hall_from(PASSES))
