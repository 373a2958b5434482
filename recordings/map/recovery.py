"""What stands in for the damaged files of a map."""

from collections.abc import Mapping, Sequence

import numpy as np

from wayfi.backend.graph.factors import BetweenFactor, Factor
from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.grid.grid_map import GridMap
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.maps.building_map import MapKeyframe
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior

BRIDGE = np.diag([0.05, 0.05, 0.02]) ** 2  # m, rad: the poses are as good as the whole graph was, a step is better


def bridged(factors: Mapping[int, Factor], poses: Floats) -> dict[int, Factor]:
    """The factors, and one by the poses for each step between keyframes that none is left of."""
    steps = {factor.b for factor in factors.values() if factor.b - factor.a == 1}
    bridges = [b for b in range(1, len(poses)) if b not in steps]
    first = max(factors, default=-1) + 1
    made: dict[int, Factor] = {first + n: _step_to(b, poses) for n, b in enumerate(bridges)}
    return dict(factors) | made


def _step_to(b: int, poses: Floats) -> BetweenFactor:
    return BetweenFactor(b - 1, b, Pose2.of(poses[b - 1]).between(Pose2.of(poses[b])), BRIDGE)


def calibration_of(calibrations: Floats) -> Calibration:
    """The wheels as they were at the newest keyframe, as uncertain as before a first drive; no receivers."""
    prior = calibration_prior(OdometryConfig())
    values = calibrations[-1] if len(calibrations) else prior.values
    return Calibration(WheelCalibration(values, prior.sigmas), {})


def redrawn(keyframes: Sequence[MapKeyframe], poses: Floats) -> OccupancyGrid:
    """The grid of the scans that are left."""
    grid = GridMap(MapConfig())
    for keyframe in keyframes:
        laser = keyframe.scan.T_base_laser if keyframe.scan else Pose2()
        grid.add(keyframe.hits, (laser.x, laser.y))
    return grid.settle(poses)
