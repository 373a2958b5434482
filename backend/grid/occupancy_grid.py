"""The occupancy grid: the evidence that each cell is occupied, and its probability."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.grid.sensor_model import LOG_ODDS

# By the bits of the evidence as uint8: -1 is 255.
_PROBABILITY = (1 / (1 + np.exp(-LOG_ODDS * np.arange(256, dtype=np.uint8).view(np.int8)))).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """`evidence` (rows, columns) int8 of the sensor model: positive for occupied, negative for free, 0 unknown.

    Row 0 has the lowest y; the lower left corner of cell [0, 0] is `origin_xy_m` in `map`.
    """

    evidence: NDArray[np.int8]
    resolution_m: float
    origin_xy_m: tuple[float, float]

    def probability(self) -> NDArray[np.float32]:
        """(rows, columns) float32 in (0, 1), 0.5 where unknown."""
        return np.take(_PROBABILITY, self.evidence.view(np.uint8), mode="clip")  # faster than its other modes
