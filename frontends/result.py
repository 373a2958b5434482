"""The result of a drive: the estimate at its end."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.factors import Factor
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.wifi.fingerprints import Fingerprint


@dataclass(frozen=True, slots=True, eq=False)
class DriveEstimate:
    """The drive as estimated at its end, with every measurement used.

    `final` and `online` (n, 3) are the poses of base_link in `map` at `stamps_ns` (n,), at the end and as they were
    published; `keyframe_poses` is (k, 3), `fingerprint_poses` (m, 3); x, y in m, theta in rad.
    """

    stamps_ns: NDArray[np.int64]
    final: Floats
    online: Floats
    keyframe_poses: Floats
    factors: dict[int, Factor]
    calibration: Calibration
    grid: OccupancyGrid
    fingerprints: list[Fingerprint]
    fingerprint_poses: Floats
