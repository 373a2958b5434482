"""The result of a drive: the estimate at its end."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.maps.building_map import BuildingMap


@dataclass(frozen=True, slots=True, eq=False)
class DriveEstimate:
    """The drive as estimated at its end, with every measurement used.

    `final` and `online` (n, 3) are the poses of base_link in `map` at `stamps_ns` (n,), at the end and as they were
    published, NaN where none was, x, y in m, theta in rad; `building` is the map that the drive has made.
    It `is_separate` from the map that the drive was to go on with where the robot was not found there.
    """

    stamps_ns: NDArray[np.int64]
    final: Floats
    online: Floats
    building: BuildingMap
    is_separate: bool = False

    @property
    def published(self) -> NDArray[np.bool_]:
        """(n,) whether a pose was published at each stamp."""
        return np.isfinite(self.online[:, 0])
