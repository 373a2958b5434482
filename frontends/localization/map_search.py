"""The search of a whole map for the places where scans fit: no initial pose, no WiFi, any heading.

It is sliced: `go_on` compares a bounded number of poses and returns. Buildings repeat, so all places are told that fit
about as well as the best one, and how nearly they do.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, wrap_all
from wayfi.frontends.localization.branch_and_bound import Bounds, Ints, advance, begun, cells_at
from wayfi.frontends.localization.place_field import LEVELS, PlaceField, building_steps
from wayfi.frontends.localization.refining import POSES, refined
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


class MapSearch:
    """Searches a floor, one `begin` after the other; what it compares with is built on the way of the first one."""

    def __init__(self, building: BuildingMap, config: MapSearchConfig, floor: int = 0) -> None:
        self._config, self._building, self._floor = config, building, floor
        self._steps: Iterator[PlaceField | None] = building_steps(building, config, floor)
        self._taken = 0  # of these steps
        self._field: PlaceField | None = None
        self._wanted: tuple[Floats, Region | None] | None = None
        self._search: _Search | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the steps, which cannot be pickled."""
        return {name: value for name, value in vars(self).items() if name != "_steps"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore, and take the steps that were taken of a field that is not complete."""
        vars(self).update(state)
        self._steps = building_steps(self._building, self._config, self._floor)
        for _ in range(self._taken if self._field is None else 0):
            next(self._steps)

    def begin(self, scans: Sequence[ScanPoints], poses: Floats, region: Region | None = None) -> bool:
        """Search for `scans` at (n, 3) poses in the base_link that is to be found; False if they have too few points.

        The last search is given up. With a `region` only poses in it are compared.
        """
        points = thinned(scans, poses, self._config.cell_m / 2)
        self._wanted = (points, region) if len(points) >= self._config.min_points else None
        self._search = None
        return self._wanted is not None

    def go_on(self, work: int) -> SearchResult | None:
        """Compare about `work` poses more, and return what was found once all are compared; None before."""
        while self._field is None and work > 0:
            self._field, work = next(self._steps), work - STEP_WORK
            self._taken += 1
        if self._wanted is None or self._field is None or work <= 0:
            return None
        if self._search is None:
            self._search = _Search(self._field, *self._wanted, self._config)
            return None
        result = self._search.go_on(work)
        if result is not None:
            self._wanted = self._search = None
        return result


class _Search:
    """One search: poses by whole cells all over the map, of which those that fit are refined."""

    def __init__(self, field: PlaceField, points: Floats, region: Region | None, config: MapSearchConfig) -> None:
        self._field, self._config = field, config
        self._fine_points = evenly(points, config.fine_points)
        self._angles = math.ceil(2 * math.pi / config.angle_step)
        angles = np.arange(self._angles, dtype=np.float64) * (2 * math.pi / self._angles)
        cells = cells_at(evenly(points, config.points), angles, field.cell_m)
        bounds = Bounds(config.min_score, config.refined_share, config.max_poses)
        first = _first_blocks(field, region)
        self._state = begun(cells, first, field, config.most_refined, config.max_waiting, bounds)
        self._compared = False
        self._refined = np.empty((0, 4))

    def go_on(self, work: int) -> SearchResult | None:
        if not self._compared:
            self._compared = advance(self._state, self._field, work)
            return None
        found = self._state.found[: self._state.counts[3]]
        some = found[len(self._refined) :][: max(1, work // POSES)]
        poses = np.empty((len(some), 3))
        poses[:, :2] = self._field.origin + self._field.cell_m * (some[:, :2] + 0.5)
        poses[:, 2] = some[:, 2] * (2 * math.pi / self._angles)
        self._refined = np.concatenate([self._refined, refined(self._fine_points, self._field, poses)])
        return self._result() if len(self._refined) == len(found) else None

    def _result(self) -> SearchResult:
        poses, _, _, found, given_up = self._state.counts.tolist()
        config, places = self._config, self._apart()
        complete = not given_up and found < config.most_refined and poses < config.max_poses
        told = tuple(Place(Pose2.of(place[:3]), float(place[3])) for place in places[: config.most])
        return SearchResult(told, complete and len(places) <= config.most, poses + found * POSES)

    def _apart(self) -> list[Floats]:
        """The best of the refined poses and its rivals (4,), apart from it and from each other, the best first."""
        config = self._config
        kept: list[Floats] = []
        left = self._refined[np.argsort(-self._refined[:, 3], kind="stable")]
        left = left[left[:, 3] >= max(config.min_score, config.rival_share * left[:1, 3].sum())]
        while len(left) and len(kept) <= config.most:
            kept.append(left[0])
            off_m = np.hypot(*(left[:, :2] - left[0, :2]).T)
            turned = np.abs(wrap_all(left[:, 2] - left[0, 2]))
            left = left[(off_m >= config.apart_m) | (turned >= config.apart_rad)]
        return kept


def evenly(points: Floats, most: int) -> Floats:
    """At most `most` of the points (n, 2), evenly from the first to the last."""
    return points[np.linspace(0, len(points) - 1, min(len(points), most)).astype(np.int64)]


def thinned(scans: Sequence[ScanPoints], poses: Floats, cell_m: float) -> Floats:
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
