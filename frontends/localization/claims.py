"""What may be claimed: when a hypothesis is confirmed, when it is doubted, and when it is given up."""

from collections.abc import Sequence

from wayfi.backend.graph.health import FailureCategory, Health, State
from wayfi.frontends.localization.hypotheses import Hypothesis
from wayfi.frontends.localization.localization_config import ClaimConfig


def why_not_confirmed(
    best: Hypothesis, rivals: Sequence[Hypothesis], searched: bool, config: ClaimConfig
) -> Health | None:
    """Why the best hypothesis is not claimed; None if it is confirmed.

    `searched` tells that no place where the robot may be has been left out.
    """
    if best.agreed < config.fixes or best.agreed_to_m - best.agreed_from_m < config.path_m:
        text = f"{best.agreed} scans agree on a place so far; {config.fixes} along {config.path_m:g} m confirm it"
        return Health(State.RELOCALISING, text, FailureCategory.NOT_FOUND_YET)
    if not searched:
        text = "other places are still being searched"
        return Health(State.RELOCALISING, text, FailureCategory.NOT_FOUND_YET)
    close = [rival for rival in rivals if best.evidence - rival.evidence < config.min_gain]
    if close:
        text = f"{len(close) + 1} places of the map look alike so far"
        return Health(State.RELOCALISING, text, FailureCategory.AMBIGUOUS)
    return None


def judge_claim(claimed: Hypothesis, state: State, elsewhere: int, config: ClaimConfig) -> Health:
    """The health of a claimed hypothesis; `elsewhere` WiFi scans in a row name a place elsewhere."""
    if claimed.contradicted >= config.lost_fixes:
        text = f"{claimed.contradicted} scans in a row contradict the map"
        return Health(State.LOST, text, FailureCategory.MAP_CONTRADICTED)
    if elsewhere >= config.wifi_fixes:
        text = f"{elsewhere} WiFi scans in a row name a place elsewhere"
        return Health(State.LOST, text, FailureCategory.WIFI_ELSEWHERE)
    if claimed.unsure >= config.unsure_fixes:
        text = f"{claimed.unsure} scans in a row do not agree with the map"
        return Health(State.UNCERTAIN, text, FailureCategory.NO_FIX)
    if elsewhere:
        return Health(State.UNCERTAIN, "WiFi names a place elsewhere", FailureCategory.WIFI_ELSEWHERE)
    if claimed.agreed < config.fixes and state is not State.TRACKING:
        text = f"{claimed.agreed} scans agree again, of {config.fixes}"
        return Health(State.UNCERTAIN, text, FailureCategory.NO_FIX)
    if claimed.agreed == 0:
        return Health(State.UNCERTAIN, "the robot was moved, or the map contradicted", FailureCategory.ROBOT_MOVED)
    return Health(State.TRACKING, f"{claimed.agreed} scans in a row agree with the map")
