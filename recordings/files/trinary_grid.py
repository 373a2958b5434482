"""The occupancy grid as a person or a planner asks for it: cells that are occupied, free or unknown."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.grid.map_config import MapConfig
from wayfi.recordings.files import map_files
from wayfi.recordings.files.map_folder import MapError

OCCUPIED, FREE, UNKNOWN = 100, 0, -1  # as in nav_msgs/msg/OccupancyGrid


@dataclass(frozen=True, slots=True, eq=False)
class TrinaryGrid:
    """`cells` (rows, columns) int8: 100 occupied, 0 free, -1 unknown.

    Row 0 has the lowest y; the lower left corner of cell [0, 0] is `origin_xy_m` in `map`.
    """

    cells: NDArray[np.int8]
    resolution_m: float
    origin_xy_m: tuple[float, float]


def trinary(
    occupancy: NDArray[np.float32], resolution_m: float, origin_xy_m: tuple[float, float], config: MapConfig
) -> TrinaryGrid:
    """The grid of (rows, columns) probabilities, by the thresholds of the configuration."""
    cells = np.full(occupancy.shape, UNKNOWN, np.int8)
    cells[occupancy >= config.occupied_probability] = OCCUPIED
    cells[occupancy <= config.free_probability] = FREE
    return TrinaryGrid(cells, resolution_m, origin_xy_m)


def read_map(directory: Path) -> TrinaryGrid:
    """The grid in map.pgm and map.yaml, as `write_map` writes them. Raises MapError."""
    try:
        about = dict(line.split(": ", 1) for line in (directory / "map.yaml").read_text(encoding="utf-8").splitlines())
        x, y, _ = (float(word) for word in about["origin"].strip("[]").split(","))
        greys = _read_pgm((directory / "map.pgm").read_bytes())
        resolution_m = float(about["resolution"])
    except OSError as error:
        raise MapError(f"{error.filename}: cannot be read: {error.strerror}") from None
    except (ValueError, KeyError) as error:
        raise MapError(f"{directory}: map.pgm and map.yaml are no map of wayfi: {error}") from None
    cells = np.full(greys.shape, UNKNOWN, np.int8)
    cells[greys == map_files.OCCUPIED] = OCCUPIED
    cells[greys == map_files.FREE] = FREE
    return TrinaryGrid(cells, resolution_m, (x, y))


def _read_pgm(data: bytes) -> NDArray[np.uint8]:
    """(rows, columns) greys of a binary PGM, row 0 at the lowest y. Raises ValueError."""
    magic, size, most, pixels = data.split(b"\n", 3)
    if (magic, most) != (b"P5", b"255"):
        raise ValueError("map.pgm is no binary PGM of 255 greys")
    columns, rows = map(int, size.split())
    return np.frombuffer(pixels, np.uint8).reshape(rows, columns)[::-1]
