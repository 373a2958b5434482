"""The search of a whole map for the places where scans fit: no initial pose, no WiFi, any heading.

It is sliced: `go_on` compares a bounded number of poses and returns. Buildings repeat, so all places are told that fit
about as well as the best one, and how nearly they do.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.localization.branch_and_bound import (
    Bounds,
    Ints,
    SearchState,
    advance,
    cells_at,
)
from wayfi.frontends.localization.place_field import LEVELS, PlaceField, building_steps
from wayfi.frontends.localization.search_config import MapSearchConfig
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.scan_points import ScanPoints

STEP_WORK = 20_000  # poses that a step of building the field costs as much as


@dataclass(frozen=True, slots=True)
class Region:
    """The part of a map within `radius_m` of a place."""

    x: float
    y: float
    radius_m: float


@dataclass(frozen=True, slots=True)
class Place:
    """A pose in the map that the scans fit, apart from the others; `score` is 0 to 1, the share of points that fit."""

    T_map_base: Pose2
    score: float


@dataclass(frozen=True, slots=True)
class SearchResult:
    """The places of one search, the best first.

    `complete` if there is no other place, apart from these, whose score is at least `rival_share` of the best one's.
    `poses` is how many were compared.
    """

    places: tuple[Place, ...]
    complete: bool
    poses: int

    @property
    def rivalry(self) -> float:
        """The second best score in shares of the best: near 1 the map has look-alikes; 0 without a second place."""
        return self.places[1].score / self.places[0].score if len(self.places) > 1 else 0.0


class MapSearch:
    """Searches a map, one `begin` after the other; what it compares with is built on the way of the first one."""

    def __init__(self, building: BuildingMap, config: MapSearchConfig) -> None:
        self._config, self._building = config, building
        self._steps: Iterator[PlaceField | None] = building_steps(building, config)
        self._taken = 0  # of these steps
        self._field: PlaceField | None = None
        self._wanted: tuple[Floats, Region | None] | None = None
        self._state: SearchState | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the steps, which cannot be pickled."""
        return {name: value for name, value in vars(self).items() if name != "_steps"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore, and take the steps that were taken of a field that is not complete."""
        vars(self).update(state)
        self._steps = building_steps(self._building, self._config)
        for _ in range(self._taken if self._field is None else 0):
            next(self._steps)

    def begin(self, scans: list[ScanPoints], poses: Floats, region: Region | None = None) -> bool:
        """Search for `scans` at (n, 3) poses in the base_link that is to be found; False if they have too few points.

        The last search is given up. With a `region` only poses in it are compared.
        """
        points = thinned(scans, poses, self._config.cell_m)
        self._state, self._wanted = None, None
        if len(points) < self._config.min_points:
            return False
        self._wanted = (
            points[np.linspace(0, len(points) - 1, min(len(points), self._config.points)).astype(int)],
            region,
        )
        return True

    def go_on(self, work: int) -> SearchResult | None:
        """Compare about `work` poses more, and return what was found once all are compared; None before."""
        while self._field is None and work > 0:
            self._field, work = next(self._steps), work - STEP_WORK
            self._taken += 1
        if self._wanted is None or self._field is None or work <= 0:
            return None
        if self._state is None:
            self._state = self._new_state(self._field, *self._wanted)
        if not advance(self._state, self._field, work):
            return None
        found, self._wanted = self._result(self._state, self._field), None
        return found

    def _new_state(self, field: PlaceField, points: Floats, region: Region | None) -> SearchState:
        config, cell_m = self._config, field.cell_m
        count = math.ceil(2 * math.pi / config.angle_step)
        angles = np.arange(count, dtype=np.float64) * (2 * math.pi / count)
        return SearchState(
            cells_at(points, angles, cell_m),
            _first_blocks(field, region),
            np.zeros(config.max_waiting, np.int64),
            np.zeros((config.most, 4)),
            np.zeros(1),
            np.zeros(5, np.int64),
            Bounds(
                config.min_score,
                config.rival_share,
                config.most,
                config.apart_m / cell_m,
                config.apart_rad * count / (2 * math.pi),
                config.max_poses,
            ),
        )

    def _result(self, state: SearchState, field: PlaceField) -> SearchResult:
        poses, _, _, found, given_up = state.counts
        places = []
        for row, column, angle, score in state.found[:found]:
            x, y = field.origin + field.cell_m * (np.array([row, column]) + 0.5)
            places.append(Place(Pose2.of((x, y, angle * 2 * math.pi / len(state.cells))), float(score)))
        complete = not given_up and found < self._config.most and poses < self._config.max_poses
        return SearchResult(tuple(places), bool(complete), int(poses))


def thinned(scans: list[ScanPoints], poses: Floats, cell_m: float) -> Floats:
    """One point (n, 2) m of each cell that the `scans` at (m, 3) `poses` have points in, by cells."""
    placed = [Pose2.of(pose).transform(scan.points) for scan, pose in zip(scans, poses, strict=True)]
    points = np.concatenate([np.zeros((0, 2)), *placed])
    points = points[np.isfinite(points).all(axis=1)]
    _, first = np.unique(np.floor(points / cell_m).astype(np.int64), axis=0, return_index=True)
    return np.ascontiguousarray(points[first])


def _first_blocks(field: PlaceField, region: Region | None) -> Ints:
    """(m, 2) row and column of the largest blocks in which a robot can be, and some of which is in the region."""
    side = 2 ** (LEVELS - 1)
    blocks = np.argwhere(field.open[-1]) * side
    if region is not None:
        middles = field.origin + field.cell_m * (blocks + side / 2)
        off = np.abs(middles - (region.x, region.y)) - field.cell_m * side / 2
        blocks = blocks[np.hypot(*np.maximum(off, 0.0).T) <= region.radius_m]
    return np.ascontiguousarray(blocks, np.int64)
