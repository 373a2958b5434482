"""A saved map in the graph of a drive that goes on with it."""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.graph.factors import BetweenFactor, Factor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.keyframes import Keyframe
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.odometry.driven_path import PathPoint


@dataclass(frozen=True, slots=True, eq=False)
class MapFix:
    """Keyframe b of a drive as it was found in a map: T_a_b from the map's keyframe a, with its (3, 3) covariance.

    `inlier_ratio` and `residual_m` tell how well its scan fits there.
    """

    a: int
    b: int
    T_a_b: Pose2
    covariance: Floats
    inlier_ratio: float
    residual_m: float


def known_factors(building: BuildingMap) -> dict[int, Factor]:
    """The factors of a map as `calibrated_factors` gives them, without those of vetoed closures."""
    vetoed = {number for closure in building.vetoed for number in building.closures[closure].factors}
    return {number: factor for number, factor in calibrated_factors(building).items() if number not in vetoed}


def calibrated_factors(building: BuildingMap) -> dict[int, Factor]:
    """The factors of a map by their numbers, for another drive: the wheels' with the calibration of their own drive."""
    return {number: _calibrated(factor, building) for number, factor in building.factors.items()}


def load_graph(graph: PoseGraph, building: BuildingMap) -> dict[int, int]:
    """Fill an empty graph with a map, at its poses; returns the number of each factor by that in the map."""
    for pose in building.poses:
        graph.add_keyframe(Pose2.of(pose))
    numbers = {number: graph.add(factor) for number, factor in known_factors(building).items()}
    graph.restart(graph.calibration_values(), building.poses)
    graph.settle()
    return numbers


def keyframes_before(building: BuildingMap, gap_m: float) -> list[Keyframe]:
    """The keyframes of a map, whose path ends `gap_m` before that of a drive which begins at 0 m."""
    paths_m = np.array([k.path_m for k in building.keyframes])
    before_m = paths_m - paths_m.max(initial=0.0) - gap_m
    return [
        Keyframe(PathPoint(k.stamp_ns, Pose2.of(pose), float(path_m)), k.scan)
        for k, pose, path_m in zip(building.keyframes, building.poses, before_m, strict=True)
    ]


def _calibrated(factor: Factor, building: BuildingMap) -> Factor:
    if not isinstance(factor, WheelFactor):
        return factor
    T = factor.motion.corrected(building.calibrations[factor.b])
    return BetweenFactor(factor.a, factor.b, T, factor.covariance)
