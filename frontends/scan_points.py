"""A scan as the estimation uses it: points and normals in base_link."""

from dataclasses import dataclass

from wayfi.backend.pose2 import Floats, Pose2


@dataclass(frozen=True, slots=True, eq=False)
class ScanPoints:
    """One sweep in base_link, as of one moment: `points` (n, 2) m and their unit `normals` (n, 2; NaN where unknown).

    `T_base_laser` is the sensor's pose.
    """

    points: Floats
    normals: Floats
    T_base_laser: Pose2
