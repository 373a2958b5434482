"""A map's graph optimised anew from its factors, and what follows from its poses: the calibration and the grid."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wayfi.backend.errors import WayfiError
from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import Factor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.grid.floor_grids import FloorGrids
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.maps.building_map import BuildingMap, MapKeyframe


class OptimisingError(WayfiError):
    """A map whose graph cannot be solved."""


@dataclass(frozen=True)
class OptimisingConfig:
    """What a map's graph is optimised with, and its grid drawn: `wheels` is the prior of each drive's wheels."""

    backend: BackendConfig
    grid: MapConfig
    wheels: WheelCalibration


def optimise(building: BuildingMap, config: OptimisingConfig) -> BuildingMap:
    """The map with the poses that its factors give, without those of vetoed closures; keyframe 0 stays where it is.

    Raises OptimisingError where they give none.
    """
    if not building.keyframes:
        return building
    graph = PoseGraph(config.backend, config.wheels, Pose2.of(building.poses[0]))
    for pose in building.poses:
        graph.add_keyframe(Pose2.of(pose))
    for factor in factors_in_force(building):
        graph.add(factor)
    poses = _solved(graph, building)
    return replace(
        building,
        poses=poses,
        calibrations=graph.calibrations_along(),
        calibration=Calibration(graph.calibration(), building.calibration.receivers),
        grids=drawn(building.keyframes, poses, config.grid),
    )


def _solved(graph: PoseGraph, building: BuildingMap) -> Floats:
    """(n, 3) the poses of a graph that is optimised from those of the map."""
    stretches = graph.stretches()
    first = np.searchsorted(stretches, np.arange(stretches[-1] + 1))  # keyframe on each stretch, or after it
    try:
        graph.restart(building.calibrations[first], building.poses)
        graph.settle()
    except RuntimeError as error:
        raise OptimisingError(f"the graph cannot be solved: {str(error).splitlines()[0]}") from error
    poses = graph.poses()
    if not np.isfinite(poses).all():
        raise OptimisingError("the graph cannot be solved: some of its poses are not finite")
    return poses


def factors_in_force(building: BuildingMap) -> list[Factor]:
    """The factors in their order, without those of vetoed closures."""
    vetoed = {number for closure in building.vetoed for number in building.closures[closure].factors}
    return [factor for number, factor in sorted(building.factors.items()) if number not in vetoed]


def drawn(keyframes: Sequence[MapKeyframe], poses: Floats, config: MapConfig) -> dict[int, OccupancyGrid]:
    """The grid of each floor: the hits of its keyframes at their `poses` (n, 3)."""
    grids = FloorGrids(config)
    for keyframe in keyframes:
        sensor = keyframe.scan.T_base_laser if keyframe.scan else Pose2()
        grids.add(keyframe.floor, keyframe.hits, (sensor.x, sensor.y))
    return grids.settle(poses, np.array([keyframe.floor for keyframe in keyframes], np.int64))
