"""The three robots, and the ranges that their errors are drawn from."""

import math
from dataclasses import dataclass
from enum import StrEnum

Range = tuple[float, float]


class Robot(StrEnum):
    """The name of an error model.

    `ideal`: constant wheel errors and range noise, nothing else. `typical`: a laser of 40 turns a second and wheels
    that nobody calibrated, in a building with people. `cheap`: the same with a coarse laser and poorer wheels.
    """

    IDEAL = "ideal"
    TYPICAL = "typical"
    CHEAP = "cheap"


@dataclass(frozen=True, slots=True)
class WheelRanges:
    """The ranges of the wheels' errors, from least to most; signs are drawn as well.

    `distance_scale` and `turn_scale` are relative errors; one robot in `1 / doubled` has twice the drawn turn scale.
    `bias_walk` is the random walk of the turn bias, rad/s per sqrt(s). `noise` multiplies the random errors.
    """

    distance_scale: Range
    turn_scale: Range
    bias_rad_per_m: Range
    bias_rad_per_s: Range
    doubled: float = 0.0
    bias_walk: Range = (0.0, 0.0)
    noise: Range = (1.0, 1.0)


@dataclass(frozen=True, slots=True)
class LaserRanges:
    """The ranges of what a real laser adds to noise, from least to most.

    A beam's light spreads by `divergence_rad`; `mixed_share` of the beams at an edge are mixed pixels. A `coarse` laser
    has one beam a degree and 2 to 7 scans a second.
    """

    divergence_rad: Range
    mixed_share: Range
    coarse: bool = False


@dataclass(frozen=True, slots=True)
class RobotModel:
    """An error model. Without `laser`, the surroundings and the returns are ideal, and no wheel slips."""

    wheels: WheelRanges
    laser: LaserRanges | None


# Within narrow bands, so that the odometry of every drive ends about equally far off.
_CALIBRATED = WheelRanges(
    distance_scale=(0.005, 0.012),
    turn_scale=(0.003, 0.006),
    bias_rad_per_m=(math.radians(0.12), math.radians(0.16)),
    bias_rad_per_s=(math.radians(0.001), math.radians(0.003)),
)
# Real logs have distance scales of 0.7 to 3.5 %, turn scales to 11 % and turn biases to 0.06 rad/m.
_UNCALIBRATED = WheelRanges(
    distance_scale=(0.0, 0.035),
    turn_scale=(0.0, 0.05),
    bias_rad_per_m=(0.0, 0.02),
    bias_rad_per_s=(0.0, 0.0003),
    doubled=0.125,
    bias_walk=(3e-5, 1.2e-4),
    noise=(0.5, 1.5),
)
_POOR = WheelRanges(
    distance_scale=(0.01, 0.035),
    turn_scale=(0.01, 0.05),
    bias_rad_per_m=(0.01, 0.06),
    bias_rad_per_s=(0.0, 0.0005),
    doubled=0.25,
    bias_walk=(6e-5, 1.2e-4),
    noise=(1.0, 2.0),
)
MODELS = {
    Robot.IDEAL: RobotModel(_CALIBRATED, None),
    Robot.TYPICAL: RobotModel(_UNCALIBRATED, LaserRanges((0.002, 0.006), (0.15, 0.5))),
    Robot.CHEAP: RobotModel(_POOR, LaserRanges((0.006, 0.015), (0.5, 0.5), coarse=True)),
}
