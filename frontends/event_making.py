"""Events of what the estimation holds."""

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.frontends.events import FingerprintAdded, GridRedrawn
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.wifi.fingerprint_index import Similar
from wayfi.frontends.wifi.fingerprints import Fingerprint

NO_HITS: NDArray[np.float32] = np.empty((0, 2), np.float32)


def points_of(scan: ScanPoints | None) -> NDArray[np.float32]:
    """(n, 2) float32 m, the points of a scan as they are drawn; none without one."""
    return NO_HITS if scan is None else scan.points.astype(np.float32)


def grid_event(stamp_ns: int, grid: OccupancyGrid) -> GridRedrawn:
    """The event of a grid as drawn at `stamp_ns`."""
    return GridRedrawn(stamp_ns, grid.probability(), grid.resolution_m, grid.origin_xy_m)


def fingerprint_event(f: Fingerprint, similar: Similar) -> FingerprintAdded:
    """The event of a fingerprint, with the earlier ones that are `similar` to it."""
    return FingerprintAdded(
        f.number, f.stamp_ns, f.receiver, f.keyframe, f.T_keyframe_base, f.readings.bssids, f.readings.rssi,
        similar.numbers, similar.similarity,
    )  # fmt: skip
