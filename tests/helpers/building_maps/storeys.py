"""Maps of drives on two floors of a building, one hall above the other, with an elevator between them."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from building_maps.halls import Hall, hall, map_of
from building_maps.rounds import CONFIG

from wayfi.backend.graph.factors import BetweenFactor
from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.optimising import drawn

NONE = Pose2()
RIDE = np.diag([0.05**2, 0.05**2, 0.01**2])  # what wheels know of the way out of a cabin


def storeys(alike: bool = False) -> tuple[Hall, Hall]:
    """A hall and the one above it, which looks `alike` or otherwise; each hears the other through the ceiling."""
    below, above = hall(0, "aa"), hall(7, "bb")
    above = replace(above, walls=below.walls if alike else above.walls)
    return replace(below, neighbour=above), replace(above, neighbour=below)


def stacked(
    parts: Mapping[int, BuildingMap], ways: Mapping[int, Floats], seed: int = 0, slip: Pose2 = NONE
) -> BuildingMap:
    """The map of a drive over floors, by the map and the true way (n, 3) on each; rides err by half of RIDE.

    `slip` is by how much they err besides, which their factors do not know.
    """
    rng, frame = np.random.default_rng(100 + seed), Pose2()
    (floor, whole), *others = parts.items()
    whole = replace(whole, keyframes=[replace(k, floor=floor) for k in whole.keyframes])
    last = Pose2.of(ways[floor][-1])
    for floor, part in others:
        n, first = len(whole.keyframes), Pose2.of(ways[floor][0])
        err = Pose2.of(0.5 * np.sqrt(np.diag(RIDE)) * rng.standard_normal(3))
        ride = last.between(first) @ err @ slip
        frame = Pose2.of(whole.poses[-1]) @ ride @ Pose2.of(part.poses[0]).inverse()
        poses = np.concatenate([whole.poses, compose_all(frame.array(), part.poses)])
        keyframes = [*whole.keyframes, *(replace(k, floor=floor) for k in part.keyframes)]
        moved = [replace(f, a=f.a + n, b=f.b + n) for f in part.factors.values()]
        ridden = BetweenFactor(n - 1, n, ride, RIDE)
        whole = replace(
            whole,
            keyframes=keyframes,
            poses=poses,
            calibrations=np.zeros((len(poses), 4)),
            factors=dict(enumerate([*whole.factors.values(), ridden, *moved])),
            fingerprints=[*whole.fingerprints, *(replace(f, keyframe=f.keyframe + n) for f in part.fingerprints)],
            weights={**whole.weights, **part.weights},
            grids=drawn(keyframes, poses, CONFIG.grid),
            pieces=(*whole.pieces, n),
        )
        last = Pose2.of(ways[floor][-1])
    return whole


def driven(halls: Mapping[int, Hall], ways: Mapping[int, Floats], seed: int = 0, slip: Pose2 = NONE) -> BuildingMap:
    """The map of a drive along `ways` (n, 3) by floor, in the halls there, floor after floor."""
    parts = {floor: map_of(halls[floor], way, seed=10 * seed + floor) for floor, way in ways.items()}
    return stacked(parts, ways, seed, slip)
