"""The settings of localisation in a saved map."""

from dataclasses import dataclass, field

from wayfi.backend.options import option
from wayfi.frontends.localization.search_config import MapSearchConfig
from wayfi.frontends.localization.wifi.belief_config import CoarseClaimConfig, WifiBeliefConfig


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
class ProposalConfig:
    """Where the map is searched for the robot, by which scans, and how the places found are followed."""

    scans: int = option(6, "", "of the last keyframes in one search: more walls, fewer look-alikes")
    reach_m: float = option(4.0, "m", "of path that these scans are from, and that places found are tried on")
    apart_m: float = option(0.5, "m", "of path between them")
    again_m: float = option(1.0, "m", "of path between two searches; a turn of 1 rad counts as 1 m")
    work: int = option(60_000, "poses", "compared in one message: 25 ms")
    wifi_sigmas: float = option(2.5, "", "of a place that WiFi names: the radius that is searched")
    wifi_weight: float = option(0.95, "", "of WiFi's belief that is searched, its best places first")
    wifi_places: int = option(6, "", "searched at most")
    sigma_m: float = option(0.15, "m", "of a place found: the cells compared are 0.2 m wide")
    sigma_rad: float = option(0.03, "rad", "as above")
    open_sigma_m: float = option(0.5, "m", "along walls that leave a place found open: places found are 1 m apart")


@dataclass(frozen=True)
class ClaimConfig:
    """When a hypothesis is confirmed, doubted, and given up."""

    fixes: int = option(4, "", "agreeing fixes, each from another place")
    apart_m: float = option(0.25, "m", "between fixes that count as independent; a turn of 1 rad counts as 1 m")
    path_m: float = option(1.2, "m", "of path along which they agree")
    open_path_m: float = option(5.0, "m", "the same where walls leave the place open along them")
    open_path_with_wifi_m: float = option(3.0, "m", "the same where WiFi names it: it errs by .4 m by then")
    fixes_with_wifi: int = option(
        2,
        "",
        "the fixes where WiFi names the place as well and no wall leaves it open; one more if any between do not agree",
    )
    path_with_wifi_m: float = option(0.9, "m", "the path there")
    evidence_per_fit: float = option(10.0, "nats", "of a scan that fits wholly over one that does not at all")
    good_quality: float = option(0.95, "", "of a fix that says nothing against a pose: true ones vary by as much")
    min_gain: float = option(4.0, "nats", "of evidence over any rival: 55 to 1")
    searches: int = option(4, "", "that find the place, where each has left out places that look as much alike")
    searches_with_wifi: int = option(2, "", "the same where WiFi tells which part of the map is searched")
    cluster_m: float = option(4.0, "m", "hypotheses of one heading this near to the best are one place, less sharp")
    cluster_rad: float = option(0.15, "rad", "as above")
    sharp_m: float = option(0.3, "m", "sigma of the position: between walls that leave it open it is UNCERTAIN")
    sharp_rad: float = option(0.05, "rad", "as above")
    max_sigma_m: float = option(
        1.1, "m", "of the position where walls leave it open: more is no claim, it may be 1 m off"
    )
    most_below_best: float = option(5.0, "nats", "that WiFi may put a place below its best one: half a turn is more")
    least_in_map: float = option(0.5, "", "of WiFi's belief that is in this map: with less of it nothing is claimed")
    min_quality: float = option(0.6, "", "of the last fixes where WiFi names the place as well; 1 is a perfect fit")
    min_quality_alone: float = option(0.85, "", "the same without WiFi; other buildings were seen to reach 0.8")
    twin_quality: float = option(0.1, "", "by which a place on another floor fits worse where there is no WiFi to tell")
    drop_gain: float = option(12.0, "nats", "by which a hypothesis is worse than the best one and is dropped")
    drop_fixes: int = option(3, "", "in a row that contradict the map: the hypothesis is dropped")
    unsure_fixes: int = option(4, "", "in a row that do not agree: UNCERTAIN")
    lost_fixes: int = option(4, "", "in a row that contradict the map: LOST")
    agreeing: int = option(3, "", "in a row that agree again: TRACKING")
    wifi_scans: int = option(3, "", "of WiFi in a row that name a place elsewhere: LOST")
    wifi_scans_apart_m: float = option(1.5, "m", "of path between scans that count: those that are nearer err alike")
    wifi_apart_m: float = option(6.0, "m", "between that place and the pose")
    wifi_below_best: float = option(8.0, "nats", "that WiFi puts the pose below its best place")


@dataclass(frozen=True)
class LocalizationConfig:
    """Localisation in a saved map."""

    most_hypotheses: int = option(40, "", "tracked together: bounds the memory")
    compared: int = option(8, "scans", "with the map in one slice of the work: 25 ms")
    slice_s: float = option(0.1, "s", "between messages, for which one slice is done")
    most_slices: int = option(2, "", "of the work in one message, 50 ms: where messages are rare, each does more")
    most_due: int = option(30, "slices", "that are made up for by the next messages")
    places: MapPlacesConfig = field(default_factory=MapPlacesConfig)
    fix: FixConfig = field(default_factory=FixConfig)
    wifi: WifiBeliefConfig = field(default_factory=WifiBeliefConfig)
    search: MapSearchConfig = field(default_factory=MapSearchConfig)
    proposals: ProposalConfig = field(default_factory=ProposalConfig)
    claim: ClaimConfig = field(default_factory=ClaimConfig)
    coarse_claim: CoarseClaimConfig = field(default_factory=CoarseClaimConfig)
