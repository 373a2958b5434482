"""The settings of the occupancy grid."""

import math
from dataclasses import dataclass

from wayfi.backend.options import option


@dataclass(frozen=True, slots=True)
class MapConfig:
    """How the occupancy grid is drawn, redrawn and written."""

    resolution_m: float = option(0.05, "m", "Nav2's and slam_toolbox's default; a door frame is two cells")
    max_range_m: float = option(30.0, "m", "a UST-20LX's reach; beyond it a beam is wider than two cells")
    occupied_probability: float = option(0.65, "", "Nav2's occupied_thresh; one hit more than passes deny")
    free_probability: float = option(0.25, "", "Nav2's free_thresh; three passes")
    margin_m: float = option(1.0, "m", "unknown cells around what was seen, so that a planner sees the map's end")
    max_cells: int = option(30_000_000, "cells", "30 MB, and as much again to draw; 270 x 270 m at 5 cm, then coarser")
    min_gap_rad: float = option(math.radians(2), "rad", "without a return: less is a lost beam, not free space")
    max_gap_rad: float = option(math.radians(20), "rad", "a wider gap may be a black car near by, not free space")
    moved_cells: float = option(0.8, "cells", "that a submap's rays end off where it is redrawn: less is not seen")
