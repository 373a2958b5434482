"""What may be claimed: when a place is confirmed, when it is doubted, and when it is given up."""

from collections.abc import Sequence

from wayfi.backend.graph.health import FailureCategory, Health, State, position_sigma
from wayfi.frontends.localization.cluster import Cluster
from wayfi.frontends.localization.localization_config import ClaimConfig
from wayfi.frontends.localization.wifi_support import WifiSupport

TURN_M = 1.0  # of path that a turn of 1 rad counts as where WiFi names the place as well: it shows as many new walls
SLACK = 2.0  # of the bounds of a sharp pose, once it is claimed: no flicker between two states


def why_not_confirmed(cluster: Cluster, wifi: WifiSupport, complete: bool, config: ClaimConfig) -> Health | None:
    """Why the best cluster of hypotheses is not claimed; None if it is confirmed.

    `complete` tells that no place where the robot may be was left out by the last search.
    """
    best = cluster.best
    if wifi.is_elsewhere(config.least_in_map):
        return _not_yet(FailureCategory.NOT_IN_MAP, "WiFi hears little that is in this map")
    sharp = cluster.is_sharp(config)
    fixes, path_m = _needed(sharp, best.all_agreed, wifi.known, config)
    turns_m = TURN_M * best.agreed_rad if sharp and wifi.known else 0.0
    if best.agreed < fixes or best.agreed_m + turns_m < path_m:
        needed = f"{fixes} along {path_m:g} m confirm it"
        return _not_yet(FailureCategory.NOT_FOUND_YET, f"{best.agreed} scans in a row agree on a place; {needed}")
    least = config.min_quality if wifi.known else config.min_quality_alone
    if best.quality < least:
        return _not_yet(FailureCategory.NOT_FOUND_YET, f"the scans fit the map to {best.quality:.2f}, under {least:g}")
    if cluster.twin_floors and not wifi.known:
        return _not_yet(FailureCategory.AMBIGUOUS, _look_alike(best.floor, cluster.twin_floors))
    if wifi.wide_nats(best.T_map_base, best.floor) < -config.most_below_best:
        return _not_yet(FailureCategory.WIFI_ELSEWHERE, "WiFi names another place than the laser")
    if cluster.gain < config.min_gain:
        return _not_yet(FailureCategory.AMBIGUOUS, f"{max(cluster.rivals, 1) + 1} places of the map look alike so far")
    if position_sigma(cluster.covariance) > config.max_sigma_m:
        return _not_yet(FailureCategory.POSE_IMPRECISE, "the walls leave the place open along them")
    if not complete and cluster.proposed < (config.searches_with_wifi if wifi.known else config.searches):
        return _not_yet(FailureCategory.AMBIGUOUS, "too many places of the map look alike so far")
    return None


def _needed(sharp: bool, all_agreed: bool, wifi: bool, config: ClaimConfig) -> tuple[int, float]:
    """How many scans have to agree, and along which path (m)."""
    if not sharp:
        return config.fixes, config.open_path_with_wifi_m if wifi else config.open_path_m
    if not wifi:
        return config.fixes, config.path_m
    return config.fixes_with_wifi + (not all_agreed), config.path_with_wifi_m


def judge_claim(cluster: Cluster, state: State, elsewhere: int, config: ClaimConfig) -> Health:
    """The health of a claimed cluster; `elsewhere` WiFi scans in a row name a place elsewhere."""
    claimed = cluster.best
    if claimed.contradicted >= config.lost_fixes:
        text = f"{claimed.contradicted} scans in a row contradict the map"
        return Health(State.LOST, text, FailureCategory.MAP_CONTRADICTED)
    if elsewhere >= config.wifi_scans:
        text = f"{elsewhere} WiFi scans in a row name a place elsewhere"
        return Health(State.LOST, text, FailureCategory.WIFI_ELSEWHERE)
    if claimed.unsure >= config.unsure_fixes:
        text = f"{claimed.unsure} scans in a row do not agree with the map"
        return Health(State.UNCERTAIN, text, FailureCategory.NO_FIX)
    if claimed.agreed < config.agreeing and (claimed.agreed == 0 or state is State.UNCERTAIN):
        text = f"{claimed.agreed} scans in a row agree with the map again, of {config.agreeing}"
        return Health(State.UNCERTAIN, text, FailureCategory.NO_FIX)
    if not cluster.is_sharp(config, SLACK if state is State.TRACKING else 1.0):
        text = "the walls leave the place open along them; WiFi and wheels tell it"
        return Health(State.UNCERTAIN, text, FailureCategory.POSE_IMPRECISE)
    return Health(State.TRACKING, f"{claimed.agreed} scans in a row agree with the map")


def _look_alike(floor: int, twins: Sequence[int]) -> str:
    *others, last = sorted([floor, *twins])
    return f"floors {', '.join(map(str, others))} and {last} look alike here, and no WiFi tells which one it is"


def _not_yet(category: FailureCategory, text: str) -> Health:
    return Health(State.RELOCALISING, text, category)
