"""What may be claimed: when a hypothesis is confirmed, when it is doubted, and when it is given up."""

from collections.abc import Sequence

from wayfi.backend.graph.health import FailureCategory, Health, State
from wayfi.frontends.localization.hypotheses import Hypothesis
from wayfi.frontends.localization.localization_config import ClaimConfig
from wayfi.frontends.localization.wifi_support import WifiSupport


def score(hypothesis: Hypothesis, wifi: WifiSupport) -> float:
    """The evidence (nats) of laser and WiFi for a hypothesis, to compare with that for others."""
    return hypothesis.evidence + wifi.nats(hypothesis.T_map_base)


def why_not_confirmed(
    best: Hypothesis, rivals: Sequence[Hypothesis], wifi: WifiSupport, complete: bool, config: ClaimConfig
) -> Health | None:
    """Why the best hypothesis is not claimed; None if it is confirmed.

    `complete` tells that no place where the robot may be was left out by the last search.
    """

    def no(category: FailureCategory, text: str) -> Health:
        return Health(State.RELOCALISING, text, category)

    if best.agreed < config.fixes or best.agreed_m < config.path_m:
        needed = f"{config.fixes} along {config.path_m:g} m confirm it"
        return no(FailureCategory.NOT_FOUND_YET, f"{best.agreed} scans in a row agree on a place; {needed}")
    if not best.is_sharp(config):
        return no(FailureCategory.POSE_IMPRECISE, "the walls leave the place open along them")
    if wifi.nats(best.T_map_base) < -config.most_below_best:
        return no(FailureCategory.WIFI_ELSEWHERE, "WiFi names another place than the laser")
    close = sum(score(best, wifi) - score(rival, wifi) < config.min_gain for rival in rivals)
    if close:
        return no(FailureCategory.AMBIGUOUS, f"{close + 1} places of the map look alike so far")
    if not complete and best.proposed < config.searches:
        return no(FailureCategory.AMBIGUOUS, "too many places of the map look alike so far")
    return None


def judge_claim(claimed: Hypothesis, state: State, elsewhere: int, config: ClaimConfig) -> Health:
    """The health of a claimed hypothesis; `elsewhere` WiFi scans in a row name a place elsewhere."""
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
    return Health(State.TRACKING, f"{claimed.agreed} scans in a row agree with the map")
