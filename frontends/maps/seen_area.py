"""Where scans have seen something: cells around their points."""

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.scan_points import ScanPoints

CELL_M = 0.15
REACH = 2  # cells around a point's own that count as seen, 0.3 to 0.45 m: an aligned drive's walls are well within


class SeenArea:
    """The cells near points that were added, as far as `low` to `high` (2,) m in `map`; nothing is seen beyond."""

    def __init__(self, low: Floats, high: Floats) -> None:
        self._low = low
        self._seen: NDArray[np.bool_] = np.zeros(np.ceil((high - low) / CELL_M).astype(int) + 1, np.bool_)

    def add(self, scan: ScanPoints | None, pose: Floats) -> None:
        """Add the points of a scan at `pose` (3,)."""
        if scan is None:
            return
        rows, columns = self._cells(scan, pose).T
        for dr in range(-REACH, REACH + 1):
            for dc in range(-REACH, REACH + 1):
                r, c = rows + dr, columns + dc
                inside = self._inside(r, c)
                self._seen[r[inside], c[inside]] = True

    def novel_share(self, scan: ScanPoints | None, pose: Floats) -> float:
        """The share of the points of a scan at `pose` (3,) that lie where none was added; 0 without points."""
        if scan is None or len(scan.points) == 0:
            return 0.0
        rows, columns = self._cells(scan, pose).T
        inside = self._inside(rows, columns)
        return 1.0 - float(self._seen[rows[inside], columns[inside]].sum()) / len(rows)

    def _cells(self, scan: ScanPoints, pose: Floats) -> NDArray[np.int64]:
        cells: NDArray[np.int64] = np.floor((Pose2.of(pose).transform(scan.points) - self._low) / CELL_M).astype(int)
        return cells

    def _inside(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.bool_]:
        height, width = self._seen.shape
        inside: NDArray[np.bool_] = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        return inside
