"""The occupancy grid as a picture that lies in the map."""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wayfi.frontends.events import GridRedrawn
from wayfi.recordings.rerun_config import RerunConfig
from wayfi.recordings.rerun_stream import Stream

UNKNOWN, FREE, OCCUPIED = 13, 38, 225
LEVELS = 33  # few greys, so that the file stays small


def _greys() -> NDArray[np.uint8]:
    p = np.linspace(0, 1, LEVELS)
    return np.rint(np.interp(p, [0, 0.5, 1], [FREE, UNKNOWN, OCCUPIED])).astype(np.uint8)


GREYS = _greys()


class Grid:
    """Draws `/map/grid`: the larger it is, the less often; the last one always."""

    def __init__(self, stream: Stream, config: RerunConfig) -> None:
        self._stream = stream
        self._cells_per_s = config.grid_cells_per_s
        self._next_ns: int | None = None
        self._waiting: GridRedrawn | None = None

    def on_grid(self, event: GridRedrawn) -> None:
        """Draw it if the last one is long enough ago for its size."""
        self._waiting = event
        if self._next_ns is None or event.stamp_ns >= self._next_ns:
            self.draw_waiting()

    def draw_waiting(self) -> None:
        """Draw what was held back, if anything."""
        event = self._waiting
        if event is None or event.occupancy.size == 0:
            return
        self._waiting = None
        self._next_ns = event.stamp_ns + int(1e9 * event.occupancy.size / self._cells_per_s)
        levels = np.rint(np.nan_to_num(event.occupancy, nan=0.5) * (LEVELS - 1)).astype(np.uint8)
        x, y = event.origin_xy_m
        size = event.resolution_m
        place = rr.Transform3D(translation=[x, y, 0.0], scale=[size, size, 1.0])
        self._stream.log("/map/grid", place, rr.Image(GREYS[levels], draw_order=-10.0))
