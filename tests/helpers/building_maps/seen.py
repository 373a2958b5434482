"""Maps of buildings with known walls, as a laser sees them from given poses."""

import numpy as np
from rooms import see

from wayfi.backend.graph.factors import Factor
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.maps.building_map import BuildingMap, MapKeyframe
from wayfi.frontends.maps.optimising import drawn
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior


def seen_map(*drives: tuple[Floats, Floats]) -> BuildingMap:
    """The map of drives one after the other: the `faces` (m, 4) of each, and the poses (n, 3) they are seen from."""
    rng, keyframes = np.random.default_rng(0), []
    for faces, poses in drives:
        for pose in poses:
            scan, k = see(faces, Pose2.of(pose), rng), len(keyframes)
            keyframes.append(MapKeyframe(k * SECOND_NS, 0.5 * k, scan, scan.points.astype(np.float32)))
    placed = np.concatenate([np.empty((0, 3)), *(poses for _, poses in drives)])
    factors: dict[int, Factor] = {}
    calibration = Calibration(calibration_prior(OdometryConfig()), {})
    grid = drawn(keyframes, placed, MapConfig())
    return BuildingMap(keyframes, placed, np.zeros((len(placed), 4)), factors, [], [], {}, calibration, grid)
