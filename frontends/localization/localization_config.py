"""The settings of localisation in a saved map."""

from dataclasses import dataclass, field

from wayfi.backend.options import option


@dataclass(frozen=True)
class MapPlacesConfig:
    """The places of a map that a scan is compared with, each the scans of the keyframes around it."""

    apart_m: float = option(2.0, "m", "between places: a scan is compared with the walls around the nearest one")
    radius_m: float = option(5.0, "m", "keyframes this near see the same walls")
    keyframes: int = option(20, "", "of a place: more add no walls")
    spacing_m: float = option(0.7, "m", "between keyframes of a place, which else hold the same walls twice")
    turn_cost_m_per_rad: float = option(0.7, "m/rad", "of that spacing: one that looks the other way sees other walls")
    kept: int = option(64, "places", "in memory, the last used: 200 kB each")


@dataclass(frozen=True)
class FixConfig:
    """How a scan is matched with the map, and when it agrees or contradicts."""

    search_above_m: float = option(0.3, "m", "sigma of the expected pose: beyond it ICP's gate may miss the walls")
    search_above_rad: float = option(0.08, "rad", "as above")
    chi2: float = option(14.0, "1", "of the pose found against the expected one: 1 in 350 true ones is beyond")
    min_window_m: float = option(0.5, "m", "to each side of what is searched")
    min_window_rad: float = option(0.15, "rad", "as above")
    max_window_m: float = option(3.0, "m", "to each side: bounds the cost; more is a matter of the search for places")
    max_window_rad: float = option(0.7, "rad", "as above")
    min_fit: float = option(0.7, "", "of the points in sight of the map that fit: less is no agreement")
    max_seen_through: float = option(0.3, "", "of the map's walls in view: a scan that passes more does not agree")
    least_fit: float = option(0.45, "", "of the points in sight that fit: less contradicts, whatever was moved")
    most_seen_through: float = option(0.5, "", "of the walls in view: more contradicts")
    sigma_floor_m: float = option(0.03, "m", "what maps bend and lasers differ by")
    sigma_floor_rad: float = option(0.005, "rad", "as above")


@dataclass(frozen=True)
class PlaceSearchConfig:
    """The bounded search of the places that are proposed."""

    window_m: float = option(2.0, "m", "to each side of a place; the places are 2 m apart")
    headings: int = option(4, "", "parts of the circle that are searched apart, so that none hides the others")
    most_places: int = option(24, "places", "in one search: those around 10 m of WiFi's uncertainty")
    min_fit: float = option(0.65, "", "of the points in sight that fit: less is not worth following")


@dataclass(frozen=True)
class ClaimConfig:
    """When a hypothesis is confirmed, doubted, and given up."""

    fixes: int = option(4, "", "agreeing fixes, each from another place")
    apart_m: float = option(0.3, "m", "of path, or of turn in 0.3 rad, between fixes that count as independent")
    path_m: float = option(1.5, "m", "of path along which they agree")
    min_gain: float = option(4.0, "nats", "of evidence over any rival: 55 to 1")
    unsure_fixes: int = option(4, "", "in a row that do not agree: UNCERTAIN")
    lost_fixes: int = option(6, "", "in a row that contradict the map: LOST")
    wifi_fixes: int = option(3, "", "of WiFi in a row that name a place elsewhere: LOST")
    wifi_apart_m: float = option(8.0, "m", "between that place and the pose")


@dataclass(frozen=True)
class LocalizationConfig:
    """Localisation in a saved map."""

    most_hypotheses: int = option(12, "", "tracked together: bounds the cost")
    places: MapPlacesConfig = field(default_factory=MapPlacesConfig)
    fix: FixConfig = field(default_factory=FixConfig)
    search: PlaceSearchConfig = field(default_factory=PlaceSearchConfig)
    claim: ClaimConfig = field(default_factory=ClaimConfig)
