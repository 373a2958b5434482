"""The result of a drive: the estimate at its end."""

from collections.abc import Sequence
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
    `floors` (n,) are those of the map at each stamp. It `is_separate` from the map that the drive was to go on with
    where the robot was not found there.
    """

    stamps_ns: NDArray[np.int64]
    final: Floats
    online: Floats
    building: BuildingMap
    floors: NDArray[np.int64]
    is_separate: bool = False

    @property
    def published(self) -> NDArray[np.bool_]:
        """(n,) whether a pose was published at each stamp."""
        return np.isfinite(self.online[:, 0])

    def path_on(self, floor: int) -> Floats:
        """(m, 2) where the robot was on a floor, m in `map`."""
        path: Floats = self.final[self.floors == floor, :2]
        return path


def floors_at(stamps_ns: NDArray[np.int64], changes: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
    """(n,) the floor at each stamp, by stamps and the floors from then on, in their order; 0 without any."""
    if not changes:
        return np.zeros(len(stamps_ns), np.int64)
    since_ns, floors = np.array(changes, np.int64).T
    known = np.clip(np.searchsorted(since_ns, stamps_ns, side="right") - 1, 0, None)
    return np.asarray(floors[known], np.int64)
