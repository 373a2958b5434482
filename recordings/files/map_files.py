"""The occupancy grids as files: map.pgm and map.yaml for Nav2's map_server, map.png to look at.

Those are of floor 0; of a further floor the names tell it, as map_floor1.yaml.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats
from wayfi.frontends.events import GridRedrawn
from wayfi.recordings.files.atomic_files import write_bytes, write_text
from wayfi.recordings.files.map_picture import map_png

GRID_FILES = ("map.pgm", "map.yaml")
OCCUPIED, FREE = 0, 254
# map_server compares (255 - grey) / 255 with the thresholds of map.yaml. The usual 205 for unknown is 0.196 there,
# which is free with a free_thresh of 0.25; 128 is 0.498.
UNKNOWN = 128


def of_floor(name: str, floor: int) -> str:
    """The name of a file of a floor, by that of floor 0."""
    stem, _, ending = name.rpartition(".")
    return f"{stem}_floor{floor}.{ending}" if floor else name


def write_map(
    directory: Path, grid: OccupancyGrid, config: MapConfig, path_xy_m: Floats | None = None, floor: int = 0
) -> None:
    """Write the grid of a floor, and a picture with the path `path_xy_m` (n, 2) m, into `directory`. Raises OSError."""
    for name, data in grid_files(grid, config, floor).items():
        write_bytes(directory / name, data)
    write_bytes(directory / of_floor("map.png", floor), map_png(grid, path_xy_m))


def write_grid(directory: Path, redrawn: GridRedrawn, config: MapConfig) -> None:
    """Write the files for map_server of a redrawn grid into `directory`. Raises OSError."""
    pgm, yaml = (of_floor(name, redrawn.floor) for name in GRID_FILES)
    write_bytes(directory / pgm, _pgm(_greys(redrawn.occupancy, config)))
    write_text(directory / yaml, _yaml(pgm, redrawn.resolution_m, redrawn.origin_xy_m, config))


def grid_files(grid: OccupancyGrid, config: MapConfig, floor: int = 0) -> dict[str, bytes]:
    """The bytes of the files for map_server of the grid of a floor."""
    every = OccupancyGrid(np.arange(256, dtype=np.uint8).view(np.int8), grid.resolution_m, grid.origin_xy_m)
    greys = np.take(_greys(every.probability(), config), grid.evidence.view(np.uint8), mode="clip")
    names = [of_floor(name, floor) for name in GRID_FILES]
    yaml = _yaml(names[0], grid.resolution_m, grid.origin_xy_m, config)
    return dict(zip(names, (_pgm(greys), yaml.encode()), strict=True))


def _greys(probability: NDArray[np.float32], config: MapConfig) -> NDArray[np.uint8]:
    greys = np.full(probability.shape, UNKNOWN, np.uint8)
    greys[probability >= config.occupied_probability] = OCCUPIED
    greys[probability <= config.free_probability] = FREE
    return greys


def _pgm(greys: NDArray[np.uint8]) -> bytes:
    """A binary PGM; its first row has the highest y."""
    rows, columns = greys.shape
    return f"P5\n{columns} {rows}\n255\n".encode() + greys[::-1].tobytes()


def _yaml(image: str, resolution_m: float, origin_xy_m: tuple[float, float], config: MapConfig) -> str:
    x, y = origin_xy_m
    return (
        f"image: {image}\n"
        "mode: trinary\n"
        f"resolution: {resolution_m!r}\n"
        f"origin: [{x:.6f}, {y:.6f}, 0.0]\n"
        "negate: 0\n"
        f"occupied_thresh: {config.occupied_probability!r}\n"
        f"free_thresh: {config.free_probability!r}\n"
    )
