"""grid.parquet: the evidence of each cell of the occupancy grid, a row of cells in each row of the table."""

import numpy as np
import pyarrow as pa

from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.recordings.map.columns import Table, parquet


def grid_table(grid: OccupancyGrid) -> bytes:
    """The evidence of a grid."""
    rows = len(grid.evidence)
    (x, y), cells = grid.origin_xy_m, [row.tobytes() for row in grid.evidence]
    return parquet(
        {
            "evidence": pa.array(cells, pa.binary()),
            "resolution_m": np.full(rows, grid.resolution_m),
            "origin_x_m": np.full(rows, x),
            "origin_y_m": np.full(rows, y),
        }
    )


def read_grid(table: Table) -> OccupancyGrid:
    """The grid in a table. Raises KeyError, IndexError or ValueError for a table of another kind."""
    cells = table.values("evidence")
    evidence = np.frombuffer(b"".join(cells), np.int8).reshape(len(cells), -1).copy()
    resolution_m, x, y = (table.values(name)[0] for name in ("resolution_m", "origin_x_m", "origin_y_m"))
    return OccupancyGrid(evidence, resolution_m, (x, y))
