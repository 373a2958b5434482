"""Particles are gathered to places: the heaviest first, floor by floor, each particle in one."""

import numpy as np
import pytest

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.localization.wifi.clusters import places_of

NEAR_M, FLOOR_M = 5.0, 0.5
HEAPS = [Pose2(-40.0, 3.0, 0.5), Pose2(35.0, -60.0, -2.0), Pose2(35.0, -60.0, 1.0)]
FLOORS = [0, -2, 5]
SHARES = [0.3, 0.5, 0.2]


@pytest.mark.parametrize("seed", [0, 1])
def test_heaps_are_told_apart_by_place_and_floor_whatever_their_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    number = rng.permutation(np.repeat([0, 1, 2], 200))
    spread = rng.normal(0.0, [0.4, 0.4, 0.1], (len(number), 3))
    poses = np.array([pose.array() for pose in HEAPS])[number] + spread
    weights = np.array(SHARES)[number] / 200
    places = places_of(poses, np.array(FLOORS)[number], weights, 8, NEAR_M, FLOOR_M)
    assert [place.floor for place in places] == [-2, 0, 5]
    assert [place.weight for place in places] == pytest.approx([0.5, 0.3, 0.2])
    for place, true in zip(places, [HEAPS[1], HEAPS[0], HEAPS[2]], strict=True):
        assert place.T_map_base.distance(true) < 0.15
        assert place.T_map_base.theta == pytest.approx(true.theta, abs=0.05)


def test_the_densest_cell_leads_and_not_its_neighbours_along_either_axis() -> None:
    poses = np.array([[x, y, 0.0] for x in (-31.0, 1.0, 33.0) for y in (-31.0, 1.0, 33.0)])
    for heaviest in range(len(poses)):
        weights = np.where(np.arange(len(poses)) == heaviest, 0.6, 0.05)
        best, *others = places_of(poses, np.zeros(len(poses), np.int64), weights, 20, NEAR_M, FLOOR_M)
        assert best.T_map_base.distance(Pose2.of(poses[heaviest])) < 1e-9
        assert len(others) == len(poses) - 1
