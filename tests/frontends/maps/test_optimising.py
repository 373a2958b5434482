import math
from dataclasses import replace

import numpy as np
import pytest
from building_maps.rounds import AROUND, CONFIG, furthest_m, round_map

from wayfi.backend.graph.factors import BetweenFactor
from wayfi.backend.pose2 import Pose2, compose_all
from wayfi.frontends.maps.optimising import OptimisingError, optimise


def test_a_map_that_agrees_with_its_factors_stays() -> None:
    building = round_map()
    optimised = optimise(building, CONFIG)
    assert furthest_m(optimised.poses, building.poses) < 1e-3
    assert np.array_equal(np.sign(optimised.grid.evidence), np.sign(building.grid.evidence))


def test_a_map_that_was_aligned_keeps_its_frame() -> None:
    building = round_map(false=(10, 40, Pose2(0.0, 8.5, math.pi)))
    T_plan_map = np.array([100.0, -30.0, 2.5])
    moved = replace(building, poses=compose_all(T_plan_map, building.poses))
    expected = compose_all(T_plan_map, optimise(building, CONFIG).poses)
    assert furthest_m(optimise(moved, CONFIG).poses, expected) < 0.01


def test_poses_come_from_the_factors_and_not_from_the_start() -> None:
    building = round_map()
    shaken = building.poses + np.random.default_rng(1).normal(0, [0.2, 0.2, 0.05], building.poses.shape)
    shaken[0] = building.poses[0]
    assert furthest_m(optimise(replace(building, poses=shaken), CONFIG).poses, building.poses) < 1e-3


def test_the_grid_is_drawn_at_the_new_poses() -> None:
    building = round_map()
    far = BetweenFactor(AROUND - 1, AROUND, Pose2(50.0, 0.0, 0.0), np.eye(3) * 1e-6)
    factors = dict(building.factors) | {AROUND - 1: far}
    vetoed = frozenset(range(1, len(building.closures)))
    torn = optimise(replace(building, factors=factors, vetoed=vetoed), CONFIG)
    assert torn.grid.evidence.shape[1] > building.grid.evidence.shape[1] + 600


def test_a_graph_that_cannot_be_solved_is_told() -> None:
    building = round_map()
    loose = {number: factor for number, factor in building.factors.items() if number != 5}
    with pytest.raises(OptimisingError, match="the graph cannot be solved"):
        optimise(replace(building, factors=loose, vetoed=frozenset(range(1, len(building.closures)))), CONFIG)


def test_a_map_without_keyframes_stays_empty() -> None:
    empty = replace(round_map(), keyframes=[], poses=np.zeros((0, 3)), calibrations=np.zeros((0, 4)), factors={})
    assert optimise(empty, CONFIG) is empty
