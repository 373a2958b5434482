"""The occupancy grids of a building, one for each floor: what is seen on one is not drawn on another."""

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.grid.drawing import Points
from wayfi.backend.grid.grid_map import NO_HITS, GridMap
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats


class FloorGrids:
    """A grid map for each floor. Each has all keyframes, by their numbers; those of other floors have no hits there."""

    def __init__(self, config: MapConfig) -> None:
        self._config = config
        self._floors: list[int] = []  # of each keyframe
        self._sensors: list[tuple[float, float]] = []
        self._grids = {0: GridMap(config)}

    def add(self, floor: int, hits: Points, sensor_xy_m: tuple[float, float] = (0.0, 0.0)) -> None:
        """Add the next keyframe's scan on its floor, as `GridMap.add` does."""
        self._begin(floor)
        for number, grid in self._grids.items():
            grid.add(hits if number == floor else NO_HITS, sensor_xy_m)
        self._floors.append(floor)
        self._sensors.append(sensor_xy_m)

    def hits(self) -> list[Points]:
        """The hits of each keyframe's scan, as they were added."""
        of_floor = {floor: grid.hits() for floor, grid in self._grids.items()}
        return [of_floor[floor][number] for number, floor in enumerate(self._floors)]

    def forget(self, first: int) -> None:
        """Remove the hits of the keyframes from number `first` on."""
        for grid in self._grids.values():
            grid.forget(first)

    @property
    def due(self) -> bool:
        """Whether a redraw of any floor is due."""
        return any(grid.due for grid in self._grids.values())

    def redraw(self, poses: Floats, floors: NDArray[np.int64]) -> OccupancyGrid:
        """The grid of the newest keyframe's floor, as `GridMap.redraw` draws it; others are redrawn where that is due.

        `floors` (n,) are those of all keyframes by now: where one has changed, all of both floors is drawn again.
        """
        self._move(floors.tolist())
        newest = self._floors[-1] if self._floors else 0
        for floor, grid in self._grids.items():
            if floor != newest and grid.due:
                grid.redraw(poses)
        return self._grids[newest].redraw(poses)

    def settle(self, poses: Floats, floors: NDArray[np.int64]) -> dict[int, OccupancyGrid]:
        """The grid of each of the `floors` (n,), with every scan at exactly its pose of `poses` (n, 3)."""
        self._move(floors.tolist())
        return {floor: self._grids[floor].settle(poses) for floor in self._known()}

    def drawn(self) -> dict[int, OccupancyGrid]:
        """The grid of each floor, 0 always among them, as it was drawn last."""
        return {floor: self._grids[floor].drawn() for floor in self._known()}

    def _known(self) -> list[int]:
        return sorted({0, *self._floors})

    def _move(self, floors: list[int]) -> None:
        if floors == self._floors:
            return
        hits, before = self.hits(), self._floors
        changed = [n for n, (old, new) in enumerate(zip(before, floors, strict=True)) if old != new]
        self._floors, first = floors, changed[0]
        for floor in sorted({before[n] for n in changed} | {floors[n] for n in changed}):
            self._begin(floor)
            own = [h if at == floor else NO_HITS for h, at in zip(hits[first:], floors[first:], strict=True)]
            self._grids[floor].replace_from(first, own)

    def _begin(self, floor: int) -> None:
        if floor not in self._grids:
            self._grids[floor] = grid = GridMap(self._config)
            for sensor_xy_m in self._sensors:
                grid.add(NO_HITS, sensor_xy_m)
