"""The occupancy grid as an image in the map."""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wayfi.frontends.events import GridRedrawn
from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.stream import RerunStream
from wayfi.recordings.rerun.views.view import Handlers

UNKNOWN, FREE, OCCUPIED = 13, 38, 225
LEVELS = 33  # few greys keep the file small
MAX_PIXELS = 1_000_000  # a viewer keeps all images of a drive in memory, uncompressed


def _greys() -> NDArray[np.uint8]:
    p = np.linspace(0, 1, LEVELS)
    return np.rint(np.interp(p, [0, 0.5, 1], [FREE, UNKNOWN, OCCUPIED])).astype(np.uint8)


GREYS = _greys()


class GridView:
    """Draws `/map/grid`: a larger grid less often and coarser, but the last one at full resolution."""

    def __init__(self, stream: RerunStream, config: RerunConfig) -> None:
        self._stream = stream
        self._cells_per_s = config.grid_cells_per_s
        self._next_ns: int | None = None
        self._waiting: GridRedrawn | None = None

    def handlers(self) -> Handlers:
        """The method that draws each kind of event."""
        return {GridRedrawn: self.on_grid}

    def on_grid(self, event: GridRedrawn) -> None:
        """Draw the grid if enough time has passed since the last one, considering its size."""
        cells = int(np.ceil(np.sqrt(event.occupancy.size / MAX_PIXELS)))
        self._waiting = event
        if event.occupancy.size and (self._next_ns is None or event.stamp_ns >= self._next_ns):
            self._next_ns = event.stamp_ns + int(SECOND_NS * event.occupancy.size / self._cells_per_s)
            self._waiting = None if cells == 1 else event
            self._draw(event, cells)

    def draw_last(self) -> None:
        """Draw the last grid at full resolution, unless it has been drawn so."""
        if self._waiting is not None and self._waiting.occupancy.size:
            self._draw(self._waiting, 1)
        self._waiting = None

    def _draw(self, event: GridRedrawn, cells: int) -> None:
        """Draw each block of `cells` x `cells` as one pixel: the highest occupancy in it."""
        levels = (event.occupancy * (LEVELS - 1) + 0.5).astype(np.uint8)
        if cells > 1:
            edges = [(0, -size % cells) for size in levels.shape]
            whole = np.pad(levels, edges)
            levels = whole.reshape(len(whole) // cells, cells, -1, cells).max(axis=(1, 3))
        (x, y), size_m = event.origin_xy_m, event.resolution_m * cells
        place = rr.Transform3D(translation=[x, y, 0.0], scale=[size_m, size_m, 1.0])
        self._stream.log("/map/grid", place, rr.Image(GREYS[levels], draw_order=-10.0))
