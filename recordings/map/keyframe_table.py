"""keyframes.parquet: where each keyframe stands, and which session and floor it is of."""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.graph.wheel_calibration import NAMES
from wayfi.backend.pose2 import Floats
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.recordings.map.columns import Table, parquet
from wayfi.recordings.map.factor_table import POSE


@dataclass(frozen=True, slots=True, eq=False)
class KeptKeyframes:
    """The columns of keyframes.parquet: `poses` (n, 3) in `map`, `calibrations` (n, 4) on the way to each."""

    stamps_ns: list[int]
    paths_m: list[float]
    sessions: list[int]
    floors: list[int]
    poses: Floats
    calibrations: Floats
    pieces: tuple[int, ...]


def keyframe_table(building: BuildingMap) -> bytes:
    """All keyframes of a map, without their scans."""
    keyframes, begins = building.keyframes, np.zeros(len(building.keyframes), bool)
    begins[list(building.pieces)] = True
    return parquet(
        {
            "stamp_ns": np.array([k.stamp_ns for k in keyframes], np.int64),
            "path_m": np.array([k.path_m for k in keyframes], np.float64),
            "session": np.array([k.session for k in keyframes], np.int64),
            "floor": np.array([k.floor for k in keyframes], np.int64),
            **{name: building.poses[:, k] for k, name in enumerate(POSE)},
            **{name: building.calibrations[:, k] for k, name in enumerate(NAMES)},
            "begins_piece": begins,
        }
    )


def read_keyframes(table: Table) -> KeptKeyframes:
    """The keyframes in a table. Raises KeyError or ValueError for a table of another kind."""
    return KeptKeyframes(
        table.values("stamp_ns"), table.values("path_m"), table.values("session"), table.values("floor"),
        table.matrix(POSE), table.matrix(NAMES), tuple(np.flatnonzero(table.numbers("begins_piece")).tolist()),
    )  # fmt: skip
