"""The systematic errors of a robot's wheel odometry, and motions corrected for them.

The state c = (s_d, s_t, b_m, b_s): scale of distance, scale of turning (both 0 when right), turn bias in rad per metre
driven and in rad per second. Between two keyframes the odometry measures (dx, dy, dtheta) over a path of L metres in t
seconds. The robot turned e = s_t dtheta + b_m L + b_s t more than that, and half of it before the middle of the path:
    dtheta' = dtheta + e,   (dx', dy') = (1 + s_d) R(e / 2) (dx, dy).
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Floats, Pose2, wrap, wrap_all

NAMES = ("distance_scale", "turn_scale", "turn_bias_rad_per_m", "turn_bias_rad_per_s")


@dataclass(frozen=True, slots=True, eq=False)
class WheelCalibration:
    """(4,) `values` of c and their standard deviations `sigmas` (4,)."""

    values: Floats
    sigmas: Floats

    def __post_init__(self) -> None:
        if self.values.shape != (4,) or self.sigmas.shape != (4,):
            raise WayfiError(f"a wheel calibration has the four numbers {', '.join(NAMES)}, each with a sigma")
        if not (np.isfinite(self.values).all() and np.isfinite(self.sigmas).all() and (self.sigmas > 0).all()):
            raise WayfiError("a wheel calibration needs finite values and sigmas above zero")
        if self.values[0] <= -1:
            raise WayfiError(f"wheels of distance scale {self.values[0]} would go nowhere: it must be above -1")


class WheelMotion(NamedTuple):
    """Wheel odometry between two moments: the pose of the later in the earlier, the path (m) and the time (s).

    `discontinuities` counts where the odometry began anew in between: the robot may have been moved by any amount.
    Where a laser led in place of wheels, `open_m2` is the variance of x and y of what it could not see, and `blind_s`
    the time in which it was silent as well.
    """

    pose: Pose2
    path_m: float
    seconds: float
    discontinuities: int = 0
    open_m2: float = 0.0
    blind_s: float = 0.0

    def corrected(self, calibration: Floats) -> Pose2:
        """The motion of the robot, whose wheels have `calibration` (4,)."""
        scale, turn_scale, per_m, per_s = calibration
        extra = turn_scale * self.pose.theta + per_m * self.path_m + per_s * self.seconds
        c, s = math.cos(extra / 2) * (1 + scale), math.sin(extra / 2) * (1 + scale)
        return Pose2(
            c * self.pose.x - s * self.pose.y, s * self.pose.x + c * self.pose.y, wrap(self.pose.theta + extra)
        )


def corrected_all(motions: Floats, calibration: Floats) -> Floats:
    """(n, 3) corrected motions of (n, 5) rows x, y, theta, path_m, seconds.

    `calibration` is one (4,), or one each (n, 4).
    """
    scale, turn_scale, per_m, per_s = calibration.T
    extra = turn_scale * motions[:, 2] + per_m * motions[:, 3] + per_s * motions[:, 4]
    c, s = np.cos(extra / 2) * (1 + scale), np.sin(extra / 2) * (1 + scale)
    x, y = motions[:, 0], motions[:, 1]
    return np.stack([c * x - s * y, s * x + c * y, wrap_all(motions[:, 2] + extra)], axis=1)


def chain(steps: Floats) -> Floats:
    """(n + 1, 3) poses from the origin, by the relative poses (n, 3) between them."""
    heading = np.concatenate([[0.0], np.cumsum(steps[:, 2])])
    c, s = np.cos(heading[:-1]), np.sin(heading[:-1])
    x = np.concatenate([[0.0], np.cumsum(c * steps[:, 0] - s * steps[:, 1])])
    y = np.concatenate([[0.0], np.cumsum(s * steps[:, 0] + c * steps[:, 1])])
    return np.stack([x, y, wrap_all(heading)], axis=1)
