"""What may be claimed without a laser: the place that WiFi and wheels name, more coarsely."""

from wayfi.backend.graph.health import FailureCategory, Health, State
from wayfi.frontends.localization.localization_config import WifiClaimConfig
from wayfi.frontends.localization.wifi_support import WifiSupport


def judge_by_wifi(wifi: WifiSupport, state: State, config: WifiClaimConfig) -> Health:
    """The health of WiFi's best place, claimed or not, for a robot whose laser is silent."""
    claimed = state in (State.TRACKING, State.UNCERTAIN)
    gone = State.LOST if claimed or state is State.LOST else State.RELOCALISING
    if not wifi.known:
        return Health(gone, "neither laser nor WiFi tells where the robot is", FailureCategory.NO_SENSOR)
    place = wifi.places[0]
    if wifi.weight < config.least_weight:
        return Health(gone, "WiFi hears little that is in this map", FailureCategory.NOT_IN_MAP)
    text = f"WiFi gives {place.weight:.2f} to a place of sigma {place.sigma_m:.1f} m"
    kept = claimed and place.weight >= config.least_weight
    sharp = place.sigma_m <= config.max_sigma_m and place.sigma_rad <= config.max_sigma_rad
    if place.weight < config.sure_weight or not sharp:
        return Health(State.UNCERTAIN if kept else gone, text, FailureCategory.AMBIGUOUS)
    return Health(State.TRACKING, f"{text}; there is no laser")
