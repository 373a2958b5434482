"""scans_*.parquet: what the laser saw at each keyframe, quantised: points to 1 mm, normals to 0.1 mrad."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from wayfi.backend.grid.drawing import Points
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.scan_points import ScanPoints
from wayfi.recordings.map.columns import PER_M, PER_RAD, UNKNOWN_NORMAL, Table, lists, parquet, quanta, split

KeptScan = tuple[ScanPoints | None, Points]  # the points for matching, if any, and the hits for the grid
NO_POINTS = ScanPoints(np.empty((0, 2)), np.empty((0, 2)), Pose2())
MOST_MM = 2_000_000_000  # what 32 bits hold: a point that is further away stays that far


def scan_table(numbers: Sequence[int], scans: Sequence[KeptScan]) -> bytes:
    """The scans of the keyframes `numbers`; a keyframe without one has none of either points."""
    points = [scan or NO_POINTS for scan, _ in scans]
    columns: dict[str, Any] = {
        "keyframe": np.array(numbers, np.int64),
        "matched": np.array([scan is not None for scan, _ in scans]),
        "laser_x_m": np.array([p.T_base_laser.x for p in points]),
        "laser_y_m": np.array([p.T_base_laser.y for p in points]),
        "laser_theta_rad": np.array([p.T_base_laser.theta for p in points]),
    }
    quantised = {
        **_in_mm("point", [p.points for p in points]),
        "normal_0.1mrad": lists([_directions(p.normals) for p in points]),
        **_in_mm("hit", [hits[np.isfinite(hits).all(axis=1)] for _, hits in scans]),
    }
    return parquet(columns | quantised, list(quantised))


def read_scans(table: Table) -> dict[int, KeptScan]:
    """The scan of each keyframe in a table. Raises KeyError or ValueError for a table of another kind."""
    points, hits = _of_mm(table, "point", np.float64), _of_mm(table, "hit", np.float32)
    lasers = [Pose2(*row) for row in table.matrix(["laser_x_m", "laser_y_m", "laser_theta_rad"]).tolist()]
    directions, ends = table.flat("normal_0.1mrad")
    normals = split(_normals(directions), ends)
    rows = zip(table.values("keyframe"), table.values("matched"), points, normals, lasers, hits, strict=True)
    return {k: (ScanPoints(p, n, laser) if matched else None, h) for k, matched, p, n, laser, h in rows}


def _in_mm(name: str, points: Sequence[NDArray[Any]]) -> dict[str, Any]:
    mm = [np.clip(quanta(p, PER_M), -MOST_MM, MOST_MM) for p in points]
    return {f"{name}_x_mm": lists([p[:, 0] for p in mm]), f"{name}_y_mm": lists([p[:, 1] for p in mm])}


def _of_mm(table: Table, name: str, dtype: DTypeLike) -> list[NDArray[Any]]:
    (x, ends), (y, _) = table.flat(f"{name}_x_mm"), table.flat(f"{name}_y_mm")
    points = np.empty((len(x), 2), dtype)
    points[:, 0], points[:, 1] = x / np.float64(PER_M), y / np.float64(PER_M)
    return split(points, ends)


def _directions(normals: Floats) -> NDArray[np.int32]:
    """(n,) directions of unit normals (n, 2) in 0.1 mrad, UNKNOWN_NORMAL where they are NaN."""
    known = np.isfinite(normals).all(axis=1)
    directions = np.full(len(normals), UNKNOWN_NORMAL, np.int32)
    directions[known] = quanta(np.arctan2(normals[known, 1], normals[known, 0]), PER_RAD)
    return directions


def _normals(directions: NDArray[np.int32]) -> Floats:
    """(n, 2) unit normals of directions in 0.1 mrad."""
    angles = np.where(directions == UNKNOWN_NORMAL, np.nan, directions / PER_RAD)
    return np.column_stack([np.cos(angles), np.sin(angles)])
