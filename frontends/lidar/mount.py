"""Where a sensor is mounted on the base."""

import math
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.measurements import StaticTransform


@dataclass(frozen=True, slots=True, eq=False)
class Mount:
    """The pose of a sensor in base_link: `rotation` (3, 3) and `translation` (3,) m."""

    rotation: Floats
    translation: Floats

    @classmethod
    def of(cls, transform: StaticTransform) -> "Mount":
        """The mount of a transform from base_link. Its quaternion may have any length above zero."""
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
    def level(cls, T_base_sensor: Pose2, height_m: float = 0.0) -> "Mount":
        """An upright sensor, `height_m` above base_link."""
        c, s = math.cos(T_base_sensor.theta), math.sin(T_base_sensor.theta)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return cls(rotation, np.array([T_base_sensor.x, T_base_sensor.y, height_m]))

    @property
    def planar(self) -> Pose2:
        """T_base_sensor in the plane: its position, and the heading of its x axis."""
        return Pose2(
            float(self.translation[0]),
            float(self.translation[1]),
            math.atan2(self.rotation[1, 0], self.rotation[0, 0]),
        )

    @property
    def upside_down(self) -> bool:
        """Whether the sensor's z axis points down: its bearings then run clockwise."""
        return bool(self.rotation[2, 2] < 0)
