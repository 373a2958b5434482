"""Scan matching in close proximity, and LiDAR closures between poses that the WiFi trajectory puts near each other.

The second half of the paper's Algorithm 1. An ICP is accepted if the matching points are at least half of the mean
number of points of the two scans. The additional scans are a share of all scans; each is matched with every scan near
it, not only with others of the share. Only this reading agrees with the paper's times for close scans and for 10 %,
given its 13 ms for an ICP.
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from wayfi.backend.pose2 import Floats, Pose2, between_all
from wayfi.frontends.lidar.icp import IcpConfig, icp
from wayfi.frontends.lidar.point_index import PointIndex, build_index
from wayfi.frontends.scan_points import ScanPoints
from wayfi.service.reproduction.messages import Progress
from wayfi.service.reproduction.wifi_closures import Closures, Pairs

CLOSE_PATH_M = 1.0
NEAR_M = 5.0
MATCHING_SHARE = 0.5

_CLOSE = IcpConfig()
_LOOP = IcpConfig(iterations=30, gate_start_m=2.0)  # WiFi's initial guess has errors of metres
_NO_PRIOR = np.zeros((3, 3))


def close_scans(scans: dict[int, ScanPoints], poses: Floats, path_m: Floats, progress: Progress) -> Closures:
    """Scan matches of poses at most 1 m of path apart, with the odometry `poses` (n, 3) as initial guess."""
    numbers = np.array(sorted(scans), np.int64)
    pairs = cKDTree(path_m[numbers, None]).query_pairs(CLOSE_PATH_M, output_type="ndarray")
    return _match_all(numbers[pairs], scans, poses, _CLOSE, progress)


def lidar_closures(
    scans: dict[int, ScanPoints], estimate: Floats, path_m: Floats, share: float, progress: Progress
) -> Closures:
    """Scan matches of a `share` of the scans with all scans at most 5 m away according to `estimate` (n, 3).

    The share is evenly spread over the drive. Pairs of `close_scans` are excluded.
    """
    numbers = np.array(sorted(scans), np.int64)
    pairs = numbers[_near_pairs(estimate[numbers, :2], share)]
    far = np.abs(path_m[pairs[:, 1]] - path_m[pairs[:, 0]]) > CLOSE_PATH_M
    return _match_all(pairs[far], scans, estimate, _LOOP, progress)


def _near_pairs(places: Floats, share: float) -> Pairs:
    """(m, 2) indices a < b of `places` (n, 2) at most 5 m apart, at least one of them in the share."""
    chosen = np.arange(0, len(places), 1 / share).astype(np.int64)
    near = cKDTree(places).query_ball_point(places[chosen], NEAR_M)
    a, b = np.repeat(chosen, [len(others) for others in near]), np.concatenate(near).astype(np.int64)
    pairs = np.unique(np.sort(np.stack([a, b], axis=1), axis=1), axis=0)
    return pairs[pairs[:, 0] < pairs[:, 1]]


def _match_all(
    pairs: Pairs, scans: dict[int, ScanPoints], poses: Floats, config: IcpConfig, progress: Progress
) -> Closures:
    """The accepted matches of `pairs`, with initial guesses from `poses`."""
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    accepted, matched = [], []
    for number, T_a_b in enumerate(_matches(pairs, scans, poses, config)):
        if T_a_b is not None:
            accepted.append(number)
            matched.append(T_a_b.array())
        if number % 100 == 0:
            progress(number / len(pairs))
    return Closures(pairs[accepted], np.array(matched).reshape(-1, 3))


def _matches(pairs: Pairs, scans: dict[int, ScanPoints], poses: Floats, config: IcpConfig) -> Iterator[Pose2 | None]:
    """T_a_b of each pair, None if it is refused. Pairs with the same a must be consecutive."""
    target_number, target = -1, None
    for a, b in pairs.tolist():
        if target is None or a != target_number:
            target_number, target = a, build_index(scans[a].points, scans[a].normals, config.gate_start_m)
        guess = Pose2.of(between_all(poses[a], poses[b])[0])
        yield _match(scans[a], target, scans[b], guess, config)


def _match(a: ScanPoints, target: PointIndex, b: ScanPoints, guess: Pose2, config: IcpConfig) -> Pose2 | None:
    result = icp(b, target, guess, _NO_PRIOR, config)
    matching = result.inlier_ratio * len(b.points)
    required = MATCHING_SHARE * (len(a.points) + len(b.points)) / 2
    return result.T_target_scan if matching >= required and result.T_target_scan.is_finite() else None
