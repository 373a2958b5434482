"""Rigid poses in space."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.measurements import Transform

SMALLEST_SQUARED_NORM = 1e-12  # of a quaternion: a smaller one was left zero


@dataclass(frozen=True, slots=True, eq=False)
class Pose3:
    """The pose of a child frame in its parent: `rotation` (3, 3) and `translation` (3,) m."""

    rotation: Floats
    translation: Floats

    @classmethod
    def of(cls, transform: Transform) -> Self:
        """The pose of a transform. Its quaternion may have any length above zero."""
        x, y, z, w = np.array(transform.rotation_xyzw) / np.linalg.norm(transform.rotation_xyzw)
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        return cls(rotation, np.array(transform.translation_xyz, np.float64))

    @classmethod
    def identity(cls) -> Self:
        """The pose of a frame in itself."""
        return cls(np.eye(3), np.zeros(3))

    def __matmul__(self, other: "Pose3") -> Self:
        """T_a_b @ T_b_c = T_a_c."""
        return type(self)(self.rotation @ other.rotation, self.rotation @ other.translation + self.translation)

    def inverse(self) -> Self:
        """T_b_a of T_a_b."""
        return type(self)(self.rotation.T, -self.rotation.T @ self.translation)

    @property
    def planar(self) -> Pose2:
        """The pose in the plane: its position, and the heading of its x axis."""
        x, y, _ = self.translation.tolist()
        return Pose2(x, y, math.atan2(self.rotation[1, 0], self.rotation[0, 0]))

    def differs(self, other: "Pose3", metres: float, radians: float) -> bool:
        """Whether the two are further apart than `metres`, or turned against each other by more than `radians`."""
        turn = self.rotation.T @ other.rotation
        sine = 0.5 * math.hypot(turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])
        angle = math.atan2(sine, 0.5 * (float(np.trace(turn)) - 1.0))
        return angle > radians or math.dist(self.translation, other.translation) > metres


def tilt(rotation_xyzw: tuple[float, float, float, float]) -> float:
    """The angle (rad, 0 to pi) between a quaternion's z axis and the parent's; NaN if it is (nearly) zero."""
    x, y, z, w = rotation_xyzw
    square = x * x + y * y + z * z + w * w
    if not square >= SMALLEST_SQUARED_NORM:
        return math.nan
    return 2.0 * math.atan2(math.hypot(x, y), math.hypot(z, w))


def heading(rotation_xyzw: tuple[float, float, float, float]) -> float:
    """The heading (rad) of a quaternion's x axis, of whatever length that is; NaN if it is (nearly) zero."""
    x, y, z, w = rotation_xyzw
    if x * x + y * y + z * z + w * w < SMALLEST_SQUARED_NORM:
        return math.nan
    return wrap(math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z))
