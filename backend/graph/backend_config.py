"""The settings of the back end."""

from dataclasses import dataclass

from wayfi.backend.options import option


@dataclass(frozen=True)
class BackendConfig:
    """The back end's settings."""

    relinearize_m: float = option(1.0, "m", "relative poses are linear in positions, as long as the headings hold")
    relinearize_rad: float = option(0.05, "rad", "half a metre of step is then off by less than a millimetre")
    relinearize_calibration: float = option(0.02, "1, rad/m or rad/s", "the wheel factor is nearly linear in it")
    leap_m: float = option(1.0, "m", "from a closure further off than this a Gauss-Newton step may diverge")
    settle_updates: int = option(5, "", "Gauss-Newton steps at a drive's end, for what the last closures moved")
    uncertain_sigma_m: float = option(1.0, "m", "above it the pose says which room, not where in it")
    lost_sigma_m: float = option(10.0, "m", "above it the pose says nothing of use to a planner")
