"""Fingerprints, and the loop candidates between two of them."""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.wifi.readings import Readings


@dataclass(frozen=True, slots=True, eq=False)
class Fingerprint:
    """The mean of the scans over a stretch of path, placed at `T_keyframe_base` of `keyframe`."""

    number: int
    stamp_ns: int
    receiver: str
    keyframe: int
    T_keyframe_base: Pose2
    point: PathPoint
    readings: Readings

    @property
    def path_m(self) -> float:
        """The path driven up to it, m."""
        return self.point.path_m

    @property
    def place(self) -> Floats:
        """(2,) m, its place in the frame of its keyframe."""
        return np.array([self.T_keyframe_base.x, self.T_keyframe_base.y])


@dataclass(frozen=True, slots=True, eq=False)
class WifiCandidate:
    """Fingerprint `b` is similar to the earlier `a`: both are of one place, to `sigma_m` along each axis.

    `mutual`: of the fingerprints that neighbour b on the path, none is more similar to a than b is.
    """

    a: Fingerprint
    b: Fingerprint
    similarity: float
    sigma_m: float
    mutual: bool = False
