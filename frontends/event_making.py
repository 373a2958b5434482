"""Events of what the estimation holds."""

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import Event, FingerprintAdded, GridRedrawn, KeyframeAdded, SubmapMatched
from wayfi.frontends.keyframes import Keyframe
from wayfi.frontends.lidar.scan_tracker import KeyframeMatch
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.wifi.fingerprint_index import Similar
from wayfi.frontends.wifi.fingerprints import Fingerprint

NO_HITS: NDArray[np.float32] = np.empty((0, 2), np.float32)


def points_of(scan: ScanPoints | None) -> NDArray[np.float32]:
    """(n, 2) float32 m, the points of a scan as they are drawn; none without one."""
    return NO_HITS if scan is None else scan.points.astype(np.float32)


def keyframe_event(number: int, keyframe: Keyframe, pose: Floats, inlier_ratio: float) -> KeyframeAdded:
    """The event of a keyframe at `pose` (3,) in `map`."""
    points = points_of(keyframe.scan)
    return KeyframeAdded(number, keyframe.point.stamp_ns, Pose2.of(pose), points, inlier_ratio)


def keyframe_events(number: int, keyframe: Keyframe, tracked: KeyframeMatch | None, poses: Floats) -> list[Event]:
    """The events of the newest keyframe, and of the match of its scan if there is one; `poses` (n, 3) are in `map`."""
    ratio = tracked.match.inlier_ratio if tracked else np.nan
    added = keyframe_event(number, keyframe, poses[-1], ratio)
    if tracked is None:
        return [added]
    submap = Pose2.of(poses[-2]).transform(tracked.submap)
    return [added, SubmapMatched(keyframe.point.stamp_ns, number, submap, Pose2.of(poses[-1]), ratio)]


def grid_event(stamp_ns: int, grid: OccupancyGrid, floor: int = 0) -> GridRedrawn:
    """The event of the grid of a floor as drawn at `stamp_ns`."""
    return GridRedrawn(stamp_ns, grid.probability(), grid.resolution_m, grid.origin_xy_m, floor)


def fingerprint_event(f: Fingerprint, similar: Similar) -> FingerprintAdded:
    """The event of a fingerprint, with the earlier ones that are `similar` to it."""
    return FingerprintAdded(
        f.number, f.stamp_ns, f.receiver, f.keyframe, f.T_keyframe_base, f.readings.bssids, f.readings.rssi,
        similar.numbers, similar.similarity,
    )  # fmt: skip
