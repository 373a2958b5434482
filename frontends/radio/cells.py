"""The cells of a radio map: a grid, of which those near where something was heard are told of."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.radio.radio_config import RadioConfig

MOST_CELLS = 20_000  # told of; a larger building has larger cells: 1,000 access points take 160 MB then


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """(n,) cells of `cell_m` with their centres `xy` (n, 2) m in map; `rows` (n,) and `columns` (n,) in a grid.

    The grid has `shape` rows and columns; row 0 has the lowest y, and the lower left corner is `origin_xy_m`.
    """

    xy: Floats
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    shape: tuple[int, int]
    origin_xy_m: tuple[float, float]
    cell_m: float

    def within(self, places: Floats, reach_m: float) -> NDArray[np.bool_]:
        """(n,) whether a cell is within `reach_m` of one of `places` (p, 2), to the width of a cell."""
        near = np.zeros(self.shape, bool)
        near[tuple(_around(places, self.cell_m, reach_m, np.array(self.origin_xy_m), self.shape).T[::-1])] = True
        return near[self.rows, self.columns]

    def image(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """The (n,) `values` as an image (rows, columns) float32, NaN where nothing is told."""
        image = np.full(self.shape, np.nan, np.float32)
        image[self.rows, self.columns] = values
        return image


def cells_near(places: Floats, config: RadioConfig) -> Cells:
    """The cells within reach of `places` (p, 2) m; larger ones than configured where there would be too many."""
    cell_m = config.cell_m
    while len((cells := _cells_of(places, cell_m, config.reach_m)).xy) > MOST_CELLS:
        cell_m *= 1.5
    return cells


def _cells_of(places: Floats, cell_m: float, reach_m: float) -> Cells:
    low = np.floor((places.min(axis=0) - reach_m) / cell_m)
    size = np.ceil((places.max(axis=0) + reach_m) / cell_m) - low
    shape, origin = (int(size[1]), int(size[0])), low * cell_m
    columns, rows = np.unique(_around(places, cell_m, reach_m, origin, shape), axis=0).T
    xy = origin + (np.column_stack([columns, rows]) + 0.5) * cell_m
    return Cells(xy, rows, columns, shape, (float(origin[0]), float(origin[1])), cell_m)


def _around(places: Floats, cell_m: float, reach_m: float, origin: Floats, shape: tuple[int, int]) -> NDArray[np.int64]:
    """(n, 2) columns and rows of the grid's cells around `places`; a cell may come twice."""
    reach = int(reach_m / cell_m)
    steps = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    steps = steps[np.hypot(*steps.T) * cell_m <= reach_m]
    at = np.unique(np.floor((places - origin) / cell_m).astype(np.int64), axis=0)
    around = (at[:, None] + steps).reshape(-1, 2)
    inside = ((around >= 0) & (around < shape[::-1])).all(axis=1)
    return np.asarray(around[inside], np.int64)
