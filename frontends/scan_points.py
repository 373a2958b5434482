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
