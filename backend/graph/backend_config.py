"""The settings of the back end."""

from dataclasses import dataclass

from wayfi.backend.options import option


@dataclass(frozen=True)
class BackendConfig:
    """The back end's settings."""

    relinearize_m: float = option(1.0, "m", "a relative pose is linear in places: only turning makes them matter")
    relinearize_rad: float = option(0.05, "rad", "half a metre of step is then off by less than a millimetre")
    relinearize_calibration: float = option(0.02, "1, rad/m or rad/s", "the wheel factor is nearly linear in it")
    leap_m: float = option(1.0, "m", "a closure further off than this leaves the basin of a Gauss-Newton step")
    settle_updates: int = option(5, "", "at the end of a drive: what the last closures moved is relinearised")
    uncertain_sigma_m: float = option(1.0, "m", "above it the pose says which room, not where in it")
    lost_sigma_m: float = option(10.0, "m", "above it the pose says nothing of use to a planner")
