"""The map of a building, as it is saved, localised in, continued and edited: keyframes, factors and fingerprints."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from wayfi.backend.graph.factors import Factor
from wayfi.backend.grid.drawing import Points
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import ClosureJudged
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.wifi.readings import Readings


@dataclass(frozen=True, slots=True, eq=False)
class MapKeyframe:
    """A keyframe of a map, `path_m` along the path of its `session`, with its scan if it has one.

    `hits` (m, 2) m in base_link are the returns that the grid is drawn from.
    """

    stamp_ns: int
    path_m: float
    scan: ScanPoints | None
    hits: Points
    session: int = 0
    floor: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class MapFingerprint:
    """A fingerprint of a map, placed at `T_keyframe_base` of `keyframe`; `readings` are the receiver's own."""

    stamp_ns: int
    receiver: str
    keyframe: int
    T_keyframe_base: Pose2
    path_m: float
    readings: Readings


@dataclass(frozen=True, slots=True, eq=False)
class MapClosure:
    """The verdict on a loop candidate, and the numbers of the factors that it has in the graph, if it has any."""

    judged: ClosureJudged
    factors: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class BuildingMap:
    """A map: keyframe k, closure k and fingerprint k are number k of their lists; `poses` (n, 3) are T_map_base.

    `calibrations` (n, 4) are those of the wheels on the way to each keyframe, `factors` is the graph by the numbers of
    its factors. The relative pose of the keyframes before and after each of `pieces` is known by closures alone.
    `weights` tells of each BSSID how well it predicts place. The factors of the closures in `vetoed` are kept, but take
    no part in the graph. `grids` are the occupancy grids by the numbers of the floors, 0 always among them.
    """

    keyframes: Sequence[MapKeyframe]
    poses: Floats
    calibrations: Floats
    factors: Mapping[int, Factor]
    closures: Sequence[MapClosure]
    fingerprints: Sequence[MapFingerprint]
    weights: Mapping[str, float]
    calibration: Calibration
    grids: Mapping[int, OccupancyGrid]
    pieces: tuple[int, ...] = ()
    vetoed: frozenset[int] = field(default_factory=frozenset)

    @property
    def floors(self) -> list[int]:
        """The numbers of the floors, in their order; [0] without keyframes."""
        return sorted({keyframe.floor for keyframe in self.keyframes}) or [0]

    @property
    def grid(self) -> OccupancyGrid:
        """The grid of floor 0, where the first drive began."""
        return self.grids[0]

    def grid_of(self, floor: int) -> OccupancyGrid:
        """The grid of a floor; that of floor 0 where there is no such floor."""
        return self.grids.get(floor, self.grid)

    def fingerprint_poses(self) -> Floats:
        """(m, 3) poses of the fingerprints in `map`."""
        placed = [(Pose2.of(self.poses[f.keyframe]) @ f.T_keyframe_base).array() for f in self.fingerprints]
        return np.array(placed).reshape(-1, 3)
