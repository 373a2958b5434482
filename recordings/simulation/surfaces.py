"""What stops a laser beam: straight faces that stand still, come and go, or move."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Pose2

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """Faces `ends` (n, 4) x1, y1, x2, y2 (m), there while `since_s` <= t < `until_s` (n,), t from the drive's start.

    A face moves by `velocity_xy` (n, 2) m/s; `ends` are where it is at `since_s` (a still face may have any).
    """

    ends: Floats
    since_s: Floats
    until_s: Floats
    velocity_xy: Floats

    def at(self, time_s: float) -> Floats:
        """(m, 4) ends of the faces that are there at `time_s`."""
        there = (self.since_s <= time_s) & (time_s < self.until_s)
        elapsed = np.where(np.isfinite(self.since_s), time_s - self.since_s, 0.0)
        shift: Floats = self.velocity_xy * elapsed[:, None]
        return (self.ends + np.hstack([shift, shift]))[there]


def still(ends: Floats, since_s: float = -np.inf, until_s: float = np.inf) -> Surfaces:
    """Faces `ends` (n, 4) that do not move, there in [`since_s`, `until_s`)."""
    n = len(ends)
    return Surfaces(ends, np.full(n, since_s), np.full(n, until_s), np.zeros((n, 2)))


def moving(ends: Floats, since_s: float, until_s: float, velocity_xy: tuple[float, float]) -> Surfaces:
    """Faces `ends` (n, 4) at `since_s`, all moving by `velocity_xy` (m/s) until they are gone at `until_s`."""
    n = len(ends)
    return Surfaces(ends, np.full(n, since_s), np.full(n, until_s), np.tile(np.array(velocity_xy), (n, 1)))


def join(parts: Sequence[Surfaces]) -> Surfaces:
    """All faces of `parts`, in their order."""
    return Surfaces(
        np.concatenate([p.ends for p in parts]),
        np.concatenate([p.since_s for p in parts]),
        np.concatenate([p.until_s for p in parts]),
        np.concatenate([p.velocity_xy for p in parts]),
    )


def polyline(points: Floats) -> Floats:
    """(n - 1, 4) faces that connect `points` (n, 2)."""
    return np.hstack([points[:-1], points[1:]])


def polygon(points: Floats) -> Floats:
    """(n, 4) faces around the closed shape with corners `points` (n, 2)."""
    return polyline(np.vstack([points, points[:1]]))


def box(x_min: float, y_min: float, x_max: float, y_max: float) -> Floats:
    """(4, 4) faces of an upright rectangle (m)."""
    return polygon(np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]]))


def placed(ends: Floats, T_map_shape: Pose2) -> Floats:
    """`ends` (n, 4) of a shape's own frame, at its place."""
    return np.hstack([T_map_shape.transform(ends[:, :2]), T_map_shape.transform(ends[:, 2:])])
