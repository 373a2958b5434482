"""What is no longer there: points of earlier scans that later ones look through."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.grid.drawing import Points
from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.point_index import block_around, sort_by_cell
from wayfi.frontends.lidar.visibility import VisibilityConfig, in_view
from wayfi.frontends.maps.building_map import MapKeyframe
from wayfi.frontends.scan_points import ScanPoints


@dataclass(frozen=True)
class StalenessConfig:
    """When a point of a scan is gone."""

    every_m: float = option(1.0, "m", "between the later scans that are looked at: nearer ones see the same")
    reach_m: float = option(8.0, "m", "of a later scan: farther away, its heading's error is a wall's thickness")
    looks: int = option(2, "scans", "that look through it, and more than meet it: one alone may err")


def without_stale_points(
    keyframes: Sequence[MapKeyframe], poses: Floats, first: int, config: StalenessConfig, visibility: VisibilityConfig
) -> list[MapKeyframe]:
    """The keyframes at `poses` (n, 3), those before the `first` later one without the points that later ones pass."""
    scans = [k.scan.points if k.scan else np.empty((0, 2)) for k in keyframes[:first]]
    ends = np.cumsum([len(points) for points in scans])
    points, gone = _placed(scans, poses), np.zeros(ends[-1] if len(scans) else 0, np.bool_)
    floors = np.repeat([k.floor for k in keyframes[:first]], [len(points) for points in scans])
    for floor in sorted({k.floor for k in keyframes[first:]}):
        looks = _later(keyframes, poses, first, config.every_m, floor)
        gone[floors == floor] = _gone(points[floors == floor], looks, config, visibility)
    split = np.split(gone, ends[:-1]) if len(scans) else []
    return [_without(k, lost) for k, lost in zip(keyframes, split, strict=False)] + list(keyframes[first:])


def _placed(scans: list[Floats], poses: Floats) -> Floats:
    """(p, 2) m, the points of all scans in `map`."""
    placed = [Pose2.of(pose).transform(points) for points, pose in zip(scans, poses, strict=False)]
    return np.concatenate(placed) if placed else np.empty((0, 2))


def _later(
    keyframes: Sequence[MapKeyframe], poses: Floats, first: int, every_m: float, floor: int
) -> list[tuple[ScanPoints, Pose2]]:
    """Scans on a floor from the `first` keyframe on, `every_m` of path apart, with their poses."""
    looks, last_m = [], -np.inf
    for k, pose in zip(keyframes[first:], poses[first:], strict=True):
        if k.floor == floor and k.scan is not None and k.path_m - last_m >= every_m:
            looks.append((k.scan, Pose2.of(pose)))
            last_m = k.path_m
    return looks


def _gone(
    points: Floats, looks: list[tuple[ScanPoints, Pose2]], config: StalenessConfig, visibility: VisibilityConfig
) -> NDArray[np.bool_]:
    """(p,) whether each of the points (p, 2) is passed by enough of the scans."""
    passed, met = np.zeros(len(points), np.int32), np.zeros(len(points), np.int32)
    if len(points) == 0:
        return np.zeros(0, np.bool_)
    order, cells = sort_by_cell(points, config.reach_m)
    for scan, T in looks:
        top, bottom, left, right = block_around(T.x, T.y, cells)
        rows = [
            slice(cells.starts[r * cells.columns + left], cells.starts[r * cells.columns + right])
            for r in range(top, bottom)
        ]
        near = np.concatenate([order[row] for row in rows]) if rows else order[:0]
        view = in_view(scan, T, points[near], visibility)
        passed[near] += view.passed
        met[near] += view.met
    gone: NDArray[np.bool_] = (passed >= config.looks) & (passed > met)
    return gone


def _without(keyframe: MapKeyframe, gone: NDArray[np.bool_]) -> MapKeyframe:
    """A keyframe without the points of its scan that are `gone` (n,), and without the hits nearest to these."""
    scan = keyframe.scan
    if scan is None or not gone.any():
        return keyframe
    left = replace(scan, points=scan.points[~gone], normals=scan.normals[~gone])
    return replace(keyframe, scan=left, hits=keyframe.hits[~gone[_nearest(keyframe.hits, scan.points)]])


@njit(cache=True)
def _nearest(hits: Points, points: Floats) -> NDArray[np.int64]:
    """(m,) row of the point (n, 2) nearest to each of the hits (m, 2)."""
    nearest = np.zeros(len(hits), np.int64)
    for i in range(len(hits)):
        best = np.inf
        for j in range(len(points)):
            d2 = (points[j, 0] - hits[i, 0]) ** 2 + (points[j, 1] - hits[i, 1]) ** 2
            if d2 < best:
                best, nearest[i] = d2, j
    return nearest
