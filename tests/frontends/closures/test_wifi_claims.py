"""What WiFi's claims say together: how much path counts as one, and how precise they turn out."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.closures.closure_config import ConsensusConfig
from wayfi.frontends.closures.wifi_claims import SHOWN, Claim, WifiClaims
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.wifi.fingerprints import Fingerprint, WifiCandidate
from wayfi.frontends.wifi.readings import Readings
from wayfi.frontends.wifi.wifi_config import WifiConfig

CONFIG, WIFI = ConsensusConfig(), WifiConfig()
NOTHING = Readings((), np.empty(0, np.float32), np.empty(0, np.float32))
SIGMA_M = 0.8
ROUND_M = 100.0


def candidate(a_m: float, b_m: float, number: int = 0) -> WifiCandidate:
    """Fingerprints `a_m` and `b_m` (m) along the path; keyframe 2 k is a of candidate k, the next one its b."""
    a, b = (
        Fingerprint(0, 0, "phone", keyframe, Pose2(), PathPoint(0, Pose2(), path_m), NOTHING)
        for keyframe, path_m in ((2 * number, a_m), (2 * number + 1, b_m))
    )
    return WifiCandidate(a, b, 0.7, SIGMA_M, mutual=True)


def second_round(spacing_m: float, length_m: float) -> tuple[WifiClaims, list[Claim]]:
    """Claims `spacing_m` apart along `length_m` of path that is driven a second time."""
    claims = WifiClaims(CONFIG, WIFI)
    places = [k * spacing_m for k in range(int(length_m / spacing_m) + 1)]
    return claims, [claims.add(k, candidate(at, ROUND_M + at, k)) for k, at in enumerate(places)]


@settings(deadline=None)
@given(st.floats(WIFI.fingerprint_m, 0.99 * WIFI.independent_m), st.floats(20.0, 80.0))
def test_claims_in_a_row_are_worth_their_path_however_many_they_are(spacing_m: float, length_m: float) -> None:
    claims, made = second_round(spacing_m, length_m)
    information = sum(claims.factor_sigma_m(claim) ** -2 for claim in made) * SIGMA_M**2
    covered_m = (len(made) - 1) * spacing_m
    assert information == pytest.approx(1 + covered_m / WIFI.independent_m)


def test_claims_of_other_stretches_are_independent() -> None:
    claims = WifiClaims(CONFIG, WIFI)
    first = claims.add(0, candidate(10.0, 110.0))
    elsewhere = claims.add(1, candidate(10.0 + 2 * WIFI.independent_m, 111.0, 1))
    later = claims.add(2, candidate(10.0, 110.0 + 2 * WIFI.independent_m, 2))
    again = claims.add(3, candidate(10.5, 110.5 + 2 * WIFI.independent_m, 3))
    assert [claims.continues(claim) for claim in (first, elsewhere, later, again)] == [False, False, False, True]
    assert [claim.candidate for claim in claims.sequence()] == [later.candidate, again.candidate]


def test_a_sequence_and_the_recent_claims_are_bounded() -> None:
    claims, made = second_round(0.5, 400.0)
    assert claims.sequence() == made[-SHOWN:]
    assert claims.recent() == made[-CONFIG.window :]
    assert len(claims.recent()) == CONFIG.window < len(made)


def test_the_share_of_true_claims_is_laplaces() -> None:
    claims, made = second_round(1.0, 7.0)
    assert claims.true_share() == pytest.approx(1 / (2 + len(made)))
    for claim in made:
        claim.factor = claim.number
    assert claims.true_share() == pytest.approx((1 + len(made)) / (2 + len(made)))


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_the_sigma_is_learnt_from_accepted_claims_and_not_from_a_few(scale: float) -> None:
    many, few = learnt(400, scale), learnt(2, scale)
    assert many == pytest.approx(scale, rel=0.2)
    assert abs(math.log(few)) < 0.3 * abs(math.log(scale))


def test_refused_claims_teach_nothing() -> None:
    assert learnt(400, 3.0, accepted=False) == 1.0


def learnt(count: int, scale: float, accepted: bool = True) -> float:
    """The factor on the sigma after a number of claims whose places lie `scale` times as far apart as claimed."""
    rng, claims = np.random.default_rng(0), WifiClaims(CONFIG, WIFI)
    poses: Floats = np.zeros((2 * count, 3))
    poses[1::2, :2] = rng.normal(0, scale * SIGMA_M, (count, 2))
    for k in range(count):
        claim = claims.add(k, candidate(k, ROUND_M + k, k))
        claim.factor = k if accepted else None
    for _ in range(3):
        claims.learn_sigma(claims.pairs(claims.recent()), poses)
    return claims.sigma_m(candidate(0.0, ROUND_M)) / SIGMA_M
