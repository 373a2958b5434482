"""Where a sensor is mounted on the base."""

import math

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.frames.pose3 import Pose3


class Mount(Pose3):
    """The pose of a sensor in base_link: `rotation` (3, 3) and `translation` (3,) m."""

    __slots__ = ()

    @classmethod
    def level(cls, T_base_sensor: Pose2, height_m: float = 0.0) -> "Mount":
        """An upright sensor, `height_m` above base_link."""
        c, s = math.cos(T_base_sensor.theta), math.sin(T_base_sensor.theta)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return cls(rotation, np.array([T_base_sensor.x, T_base_sensor.y, height_m]))

    @property
    def upside_down(self) -> bool:
        """Whether the sensor's z axis points down: its bearings then run clockwise."""
        return bool(self.rotation[2, 2] < 0)
