"""The settings of the back end."""

from dataclasses import dataclass

from wayfi.backend.options import option


@dataclass(frozen=True)
class BackendConfig:
    """The back end's settings."""

    relinearize_m: float = option(1.0, "m", "relative poses are linear in positions, as long as the headings hold")
    relinearize_rad: float = option(0.05, "rad", "half a metre of step is then off by less than a millimetre")
    relinearize_calibration: float = option(0.02, "1, rad/m or rad/s", "the wheel factor is nearly linear in it")
    stretch_m: float = option(10.0, "m", "of path on which the wheels' calibration is one: 20 steps, 20 s of driving")
    walk_distance_scale: float = option(0.0003, "1 per sqrt(m)", "of the calibration's random walk: floors differ")
    walk_turn_scale: float = option(0.0006, "1 per sqrt(m)", "as above")
    walk_turn_bias_rad_per_m: float = option(
        0.001, "rad/m per sqrt(m)", "at least; a drive teaches more: to 0.002 on real robots"
    )
    walk_turn_bias_rad_per_s: float = option(0.0001, "rad/s per sqrt(m)", "gyroscopes: 3e-5 to 1e-4 rad/s per sqrt(s)")
    unobserved_walk: float = option(0.1, "", "of these where no scan match shows it: closures would bend it at will")
    taught_m: float = option(50.0, "m", "of path with matches, from which on they have taught these: five stretches")
    axes_stretches: int = option(5, "", "of these stretches on which a building's axes have one direction: 50 m")
    walk_axes_rad: float = option(0.01, "rad", "between those, where the way was driven along: it follows no wall")
    walk_walls_rad: float = option(0.002, "rad", "between those, where scans saw walls: none was found over 300 m")
    leap_m: float = option(1.0, "m", "from a closure further off than this a Gauss-Newton step may diverge")
    settle_updates: int = option(5, "", "Gauss-Newton steps at a drive's end, for what the last closures moved")
    uncertain_sigma_m: float = option(1.0, "m", "above it the pose says which room, not where in it")
    lost_sigma_m: float = option(10.0, "m", "above it the pose says nothing of use to a planner")
