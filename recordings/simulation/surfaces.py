"""Straight faces that a laser beam hits: static, temporary or moving ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Pose2

Floats = NDArray[np.float64]


class Material(IntEnum):
    """The material of a face: plaster and the like, black paint, or glass."""

    PLAIN = 0
    BLACK = 1
    GLASS = 2


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """Faces `ends` (n, 4) x1, y1, x2, y2 (m), which exist while `since_s` <= t < `until_s` (n,), t from the start.

    A face moves by `velocity_xy` (n, 2) m/s from its `ends` at `since_s`. `material` (n,) holds values of Material.
    """

    ends: Floats
    since_s: Floats
    until_s: Floats
    velocity_xy: Floats
    material: NDArray[np.int8]

    @property
    def moves(self) -> NDArray[np.bool_]:
        """(n,) whether each face moves."""
        return np.asarray((self.velocity_xy != 0.0).any(axis=1))

    def where(self, chosen: NDArray[np.bool_]) -> "Surfaces":
        """The `chosen` (n,) faces, in their order."""
        return Surfaces(
            self.ends[chosen],
            self.since_s[chosen],
            self.until_s[chosen],
            self.velocity_xy[chosen],
            self.material[chosen],
        )

    def around(self, xy: Floats, reach_m: float, since_s: float, until_s: float) -> "Surfaces":
        """The faces that may be within `reach_m` of one of `xy` (k, 2) at any time in [`since_s`, `until_s`]."""
        exists = (self.since_s <= until_s) & (self.until_s > since_s)
        low, high = xy.min(axis=0) - reach_m, xy.max(axis=0) + reach_m
        x, y = self.ends[:, [0, 2]], self.ends[:, [1, 3]]
        near = (x.min(axis=1) < high[0]) & (x.max(axis=1) > low[0]) & (y.min(axis=1) < high[1])
        return self.where(exists & ((near & (y.max(axis=1) > low[1])) | self.moves))


def still(ends: Floats, since_s: float = -np.inf, until_s: float = np.inf) -> Surfaces:
    """Plain static faces `ends` (n, 4), which exist in [`since_s`, `until_s`)."""
    return moving(ends, since_s, until_s, (0.0, 0.0))


def moving(ends: Floats, since_s: float, until_s: float, velocity_xy: tuple[float, float]) -> Surfaces:
    """Plain faces `ends` (n, 4) at `since_s`, which move by `velocity_xy` (m/s) until `until_s`."""
    n = len(ends)
    velocities = np.tile(np.array(velocity_xy), (n, 1))
    return Surfaces(ends, np.full(n, since_s), np.full(n, until_s), velocities, np.zeros(n, np.int8))


def join(parts: Sequence[Surfaces]) -> Surfaces:
    """All faces of `parts`, in their order."""
    return Surfaces(
        np.concatenate([p.ends for p in parts]),
        np.concatenate([p.since_s for p in parts]),
        np.concatenate([p.until_s for p in parts]),
        np.concatenate([p.velocity_xy for p in parts]),
        np.concatenate([p.material for p in parts]),
    )


def polyline(points: Floats) -> Floats:
    """(n - 1, 4) faces that connect `points` (n, 2)."""
    return np.hstack([points[:-1], points[1:]])


def polygon(points: Floats) -> Floats:
    """(n, 4) faces of the polygon with corners `points` (n, 2)."""
    return polyline(np.vstack([points, points[:1]]))


def box(x_min: float, y_min: float, x_max: float, y_max: float) -> Floats:
    """(4, 4) faces of an axis-aligned rectangle (m)."""
    return polygon(np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]]))


def transformed(ends: Floats, T_map_shape: Pose2) -> Floats:
    """`ends` (n, 4), transformed from the frame of a shape to `map`."""
    return np.hstack([T_map_shape.transform(ends[:, :2]), T_map_shape.transform(ends[:, 2:])])
