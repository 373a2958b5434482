"""A scan as the estimation uses it: points in base_link, thinned with normals, and as they are drawn."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2


@dataclass(frozen=True, slots=True, eq=False)
class ScanPoints:
    """One sweep in base_link, as of one moment: `points` (n, 2) m and their unit `normals` (n, 2; NaN where unknown).

    `T_base_laser` is the sensor's pose.
    """

    points: Floats
    normals: Floats
    T_base_laser: Pose2


@dataclass(frozen=True, slots=True, eq=False)
class PlacedScan:
    """A sweep as of one moment: thinned `points` with normals, and all `hits` (n, 2) float32 m in base_link.

    `band` (m, 3) m holds the height band's points of the cloud that the scan was cut from, if it was.
    """

    points: ScanPoints
    hits: NDArray[np.float32]
    band: Floats | None = None


def moved(placed: PlacedScan, T: Pose2) -> PlacedScan:
    """The scan in a frame in which its own base_link is at `T`."""
    turn = Pose2(0.0, 0.0, T.theta)
    points = ScanPoints(
        T.transform(placed.points.points), turn.transform(placed.points.normals), T @ placed.points.T_base_laser
    )
    band = placed.band
    if band is not None:
        band = np.column_stack([T.transform(band[:, :2]), band[:, 2]])
    return PlacedScan(points, T.transform(placed.hits.astype(np.float64)).astype(np.float32), band)


def joined(scans: list[PlacedScan]) -> PlacedScan:
    """One scan of several in the same base_link, as if seen from amid their sensors; the hits by their bearings."""
    if len(scans) == 1:
        return scans[0]
    sensors = [scan.points.T_base_laser for scan in scans]
    amid = Pose2(float(np.mean([s.x for s in sensors])), float(np.mean([s.y for s in sensors])), 0.0)
    hits = np.concatenate([scan.hits for scan in scans])
    by_bearing = np.argsort(np.arctan2(hits[:, 1] - amid.y, hits[:, 0] - amid.x), kind="stable")
    points = ScanPoints(
        np.concatenate([scan.points.points for scan in scans]),
        np.concatenate([scan.points.normals for scan in scans]),
        amid,
    )
    bands = [scan.band for scan in scans if scan.band is not None]
    return PlacedScan(points, hits[by_bearing], np.concatenate(bands) if bands else None)
