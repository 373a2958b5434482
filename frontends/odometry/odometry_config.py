"""The settings of wheel odometry: keyframes, the driven path, the time base, and how wheels err."""

from dataclasses import dataclass, field

import numpy as np

from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.options import option


@dataclass(frozen=True)
class ClockConfig:
    """When stamps that jump are faults, and when the clock was set."""

    lasting_jump_s: float = option(1.0, "s", "back; less is messages out of order, which are dropped one by one")
    lasting_messages: int = option(5, "messages", "in a row on the other side of a jump: broken stamps come singly")
    leap_s: float = option(60.0, "s", "ahead: one message is a broken stamp, as many as above are a gap in the data")


@dataclass(frozen=True)
class AxesConfig:
    """When the wheels alone tell the axes of the building, along which robots mostly drive."""

    enabled: bool = option(True, "", "false in round halls, where a wide circle is taken for a corridor at first")
    sample_m: float = option(2.0, "m", "of path to one sample: over it a robot that avoids something has come back")
    sigma_rad: float = option(0.1, "rad", "by which a sample's heading differs from its axis: 0.2 m to a side in 2 m")
    share_along: float = option(0.5, "share", "of samples along an axis, at first; then it is learnt")
    most_along: float = option(0.9, "share", "of that share: every robot goes round something")
    turning_rad: float = option(0.35, "rad", "within a sample: a robot that turns says nothing of axes")
    memory_samples: float = option(50.0, "samples", "over which that share is learnt: a floor of a building")
    share_other_wing: float = option(0.002, "share", "of samples that begin a wing at an angle: one in 1 km")
    share_slip: float = option(0.01, "share", "of samples before which the wheels slipped sideways: one in 100 m")
    slip_rad: float = option(0.3, "rad", "by which they turned the robot then, at random")
    walk_rad_per_m: float = option(0.0005, "rad/m per sqrt(m)", "of the turn bias: real robots need this to 0.002")
    min_evidence: float = option(7.0, "", "nats for axes, before one is believed: 1,000 to 1")
    min_posterior: float = option(0.9, "", "that a sample was driven along one axis, before its heading is used")
    leap_rad: float = option(0.2, "rad", "that an axis bends the past: from further off the graph begins anew")
    samples_after: int = option(5, "samples", "10 m of path, by which a sample is decided")


@dataclass(frozen=True)
class OdometryConfig:
    """Keyframes, the driven path, and how wheels err."""

    unit_m: float = option(1.0, "m", "of its positions: 0.001 for millimetres, which are found out by their speeds too")
    base_frame: str = option("", "frame", "whose pose the odometry gives, for mounts; empty: its child_frame_id")
    keyframe_distance_m: float = option(0.5, "m", "a submap keeps its detail, 1 km stays 2,000 keyframes")
    keyframe_turn_rad: float = option(0.5, "rad", "half of what a scan still overlaps when the view is 180 degrees")
    keyframe_seconds: float = option(10.0, "s", "a robot that creeps or waits still gets one, if it moved at all")
    keyframe_still_m: float = option(0.05, "m", "less motion than this is standing still")
    keyframe_still_rad: float = option(0.05, "rad", "as above")
    keyframe_min_factor: float = option(0.2, "", "of these distances where the wheels are poor: one every 0.1 m")
    path_s: float = option(30.0, "s", "of path are kept for scans and readings that come late; phones' are seconds old")
    laser_lead_s: float = option(
        2.0, "s", "of scans without odometry until the laser leads: longer than any hiccup seen"
    )
    regain_s: float = option(
        15.0,
        "s",
        "of silence, after which wheels tell the way meanwhile: 0.1 m and 0.03 rad; over 60 s 6 m and 0.5 rad",
    )
    regain_rad: float = option(0.1, "rad", "by which they may contradict the turn by what led meanwhile")
    max_speed_m_s: float = option(5.0, "m/s", "indoor robots drive below 3; faster is a reset of the odometry")
    min_leap_m: float = option(0.5, "m", "a shorter step is no reset, whatever its speed: stamps of a burst lie close")
    max_turn_rad_s: float = option(8.0, "rad/s", "a real robot that was bumped had 6; faster is a reset")
    min_leap_rad: float = option(0.8, "rad", "as above; a real recording has 0.6 within 5 ms")
    restart_m: float = option(
        0.5, "m", "after a pause: a pose this near the odometry's origin, from over twice as far, is a restart"
    )
    restart_s: float = option(1.0, "s", "a restart that takes longer, or does not begin at the origin, hides a motion")
    sigma_xy_per_sqrt_m: float = option(0.02, "m per sqrt(m)", "random part of the distance: 2 cm over 1 m")
    sigma_theta_per_sqrt_m: float = option(0.003, "rad per sqrt(m)", "what real logs leave once the bias is known")
    sigma_theta_per_sqrt_rad: float = option(0.02, "rad per sqrt(rad)", "wheels slip when they turn: 1 degree in 1 rad")
    sigma_still_m: float = option(0.003, "m", "what standing still leaves open")
    sigma_still_rad: float = option(0.002, "rad", "as above")
    spin_around_m: float = option(
        5.0, "m", "of path before and after, whose usual speed a wheel that spins exceeds; it spins over less than half"
    )
    spin_doubted_m: float = option(
        0.1, "m", "of a wheel's excess that the laser has to see, for half of what is learnt"
    )
    share_spins: float = option(
        0.001, "share", "of the times that the wheels are faster for a while, at first: it is rare"
    )
    sigma_restart_m: float = option(
        1.0, "m", "a robot that was pushed aside while nothing ran, and its odometry began anew"
    )
    sigma_restart_rad: float = option(0.5, "rad", "as above")
    prior_distance_scale: float = option(0.035, "1", "real logs have 0.7 to 3.5 %: tyres, and what a driver assumes")
    prior_turn_scale: float = option(0.03, "1", "the wheels' track as it is measured by hand")
    prior_turn_bias_rad_per_m: float = option(0.03, "rad/m", "real robots were seen to turn 0.026 by themselves")
    prior_turn_bias_rad_per_s: float = option(0.0005, "rad/s", "a gyroscope's bias; wheels have none")
    clock: ClockConfig = field(default_factory=ClockConfig)
    axes: AxesConfig = field(default_factory=AxesConfig)


def calibration_prior(config: OdometryConfig) -> WheelCalibration:
    """The wheels' calibration before anything is known of them: no error, with the configured sigmas."""
    sigmas = np.array(
        [
            config.prior_distance_scale,
            config.prior_turn_scale,
            config.prior_turn_bias_rad_per_m,
            config.prior_turn_bias_rad_per_s,
        ]
    )
    return WheelCalibration(np.zeros(4), sigmas)
