"""The grid of a saved map as it is published."""

from pathlib import Path

from wayfi.backend.grid.map_config import MapConfig
from wayfi.frontends.event_making import grid_event
from wayfi.frontends.frames.frames_config import FramesConfig
from wayfi.recordings.files.map_folder import GRID
from wayfi.recordings.files.replaced_together import read_current
from wayfi.recordings.map.columns import read_parquet
from wayfi.recordings.map.grid_table import read_grid
from wayfi.service.transport.output_messages import map_message


def grid_message(folder: Path, config: MapConfig, frames: FramesConfig) -> bytes:
    """The grid of the common map in `folder`, which is whole, as an OccupancyGrid in the frame of a fleet, CDR."""
    grid = read_grid(read_parquet(read_current(folder, GRID)))
    return map_message(grid_event(0, grid), config, frames.common)
