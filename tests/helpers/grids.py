"""A room as scans of it, drives in it, and occupancy grids of them."""

import math
from collections.abc import Sequence

import numpy as np

from wayfi.backend.grid.drawing import Points
from wayfi.backend.grid.grid_map import GridMap
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats

CONFIG = MapConfig()
WIDTH_M, HEIGHT_M = 6.0, 5.0
BEARINGS = np.radians(np.arange(-135, 135.1, 0.25))
FEW_BEARINGS = BEARINGS[::20]


def room_scan(
    pose: Floats, noise: np.random.Generator | None = None, sensor_x_m: float = 0.0, bearings: Floats = BEARINGS
) -> Points:
    """What a laser `sensor_x_m` ahead of base_link sees of an empty room, its lower left corner at the origin."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = pose[0] + c * sensor_x_m, pose[1] + s * sensor_x_m
    across, up = np.cos(bearings + pose[2]), np.sin(bearings + pose[2])
    with np.errstate(divide="ignore"):
        ranges = np.minimum(
            np.where(across > 0, WIDTH_M - x, x) / np.abs(across),
            np.where(up > 0, HEIGHT_M - y, y) / np.abs(up),
        )
    ranges += noise.normal(0.0, 0.01, ranges.shape) if noise else 0.0
    hits = ranges[:, None] * np.c_[np.cos(bearings), np.sin(bearings)] + [sensor_x_m, 0.0]
    return hits.astype(np.float32)


def drive(count: int = 40) -> Floats:
    angles = np.linspace(0, 4 * math.pi, count)
    radius = np.linspace(0.1, 1.5, count)
    return np.c_[3 + radius * np.cos(angles), 2.5 + radius * np.sin(angles), 3 * angles]


def mapped(scans: Sequence[Points], config: MapConfig = CONFIG, sensor_x_m: float = 0.0) -> GridMap:
    grid = GridMap(config)
    for hits in scans:
        grid.add(hits, (sensor_x_m, 0.0))
    return grid


def drawn(poses: Floats, scans: Sequence[Points], config: MapConfig = CONFIG, sensor_x_m: float = 0.0) -> OccupancyGrid:
    """The grid from nothing."""
    return mapped(scans, config, sensor_x_m).settle(poses)


def cells(grid: OccupancyGrid, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    columns = np.floor((x - grid.origin_xy_m[0]) / grid.resolution_m).astype(int)
    rows = np.floor((y - grid.origin_xy_m[1]) / grid.resolution_m).astype(int)
    return rows, columns


def probability_at(grid: OccupancyGrid, x: Floats, y: Floats) -> Floats:
    return grid.probability()[cells(grid, x, y)].astype(float)
