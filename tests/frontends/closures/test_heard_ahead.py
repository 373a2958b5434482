"""How far ahead WiFi hears: found from passes in opposite directions, and left alone where nothing tells it."""

import math

import numpy as np
import pytest

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import NearFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.closures.closure_config import ConsensusConfig
from wayfi.frontends.closures.heard_ahead import PRIOR_M, learn_heard_ahead
from wayfi.frontends.closures.wifi_claims import WifiClaims
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior
from wayfi.frontends.odometry.wheel_noise import wheel_covariance
from wayfi.frontends.wifi.fingerprints import Fingerprint, WifiCandidate
from wayfi.frontends.wifi.readings import Readings
from wayfi.frontends.wifi.wifi_config import WifiConfig

STEP_M, PASS_STEPS, SIGMA_M = 0.5, 80, 0.8
NOTHING = Readings((), np.empty(0, np.float32), np.empty(0, np.float32))


def aisle(passes: int, back: bool) -> PoseGraph:
    """Passes of one aisle of 40 m, there and back or always the same way, as the wheels tell them."""
    odometry = OdometryConfig()
    graph = PoseGraph(BackendConfig(), calibration_prior(odometry))
    graph.add_keyframe(Pose2())
    turn, still = Pose2(0.0, 0.0, math.pi), Pose2(-STEP_M * (PASS_STEPS - 1), 0.0, 0.0)
    for k in range(1, passes * PASS_STEPS):
        step = (turn if back else still) if k % PASS_STEPS == 0 else Pose2(STEP_M, 0.0, 0.0)
        motion = WheelMotion(step, math.hypot(step.x, step.y), 1.0)
        graph.add_keyframe(graph.pose(k - 1) @ step)
        graph.add(WheelFactor(k - 1, k, motion, wheel_covariance(motion, odometry), alone=True))
        graph.update()
    return graph


def close(graph: PoseGraph, ahead_m: float, back: bool, turned: float = 0.0) -> WifiClaims:
    """Claims of each metre between a pass and the next; fingerprints sound as places `ahead_m` ahead.

    Each is taken where the robot looks `turned` from its keyframe.
    """
    claims = WifiClaims(ConsensusConfig(), WifiConfig())
    for b in range(PASS_STEPS, graph.keyframes, 2):
        number, k = divmod(b, PASS_STEPS)
        a = (number - 1) * PASS_STEPS + (PASS_STEPS - 1 - k if back else k)
        heard = -2 * ahead_m if back else 0.0  # that of b at its place is heard at another place of a's pass
        fingerprints = [
            Fingerprint(0, 0, "phone", at, T, PathPoint(0, Pose2(), at * STEP_M), NOTHING)
            for at, T in ((a, Pose2(heard, 0.0, turned)), (b, Pose2(0.0, 0.0, turned)))
        ]
        claim = claims.add(len(claims.all()), WifiCandidate(*fingerprints, 0.7, SIGMA_M, True))
        claim.factor = graph.add(NearFactor(a, b, *claims.places(claim.candidate), claims.factor_sigma_m(claim)))
    graph.settle()
    return claims


def length_m(graph: PoseGraph) -> float:
    """From one end of the aisle to the other, in the mean of all passes."""
    x = graph.poses()[:, 0]
    return float(x.max() - x.min())


@pytest.mark.parametrize("ahead_m", [-0.4, 0.0, 0.3])
def test_passes_in_opposite_directions_tell_how_far_ahead_wifi_hears(ahead_m: float) -> None:
    graph = aisle(4, back=True)
    claims = close(graph, ahead_m, back=True)
    bent_m = abs(length_m(graph) - STEP_M * (PASS_STEPS - 1))
    assert learn_heard_ahead(graph, claims)
    graph.settle()
    assert claims.ahead_m == pytest.approx(ahead_m, abs=0.1)
    assert abs(length_m(graph) - STEP_M * (PASS_STEPS - 1)) <= max(0.05, bent_m / 4)


def test_the_distance_is_along_the_robots_own_heading() -> None:
    graph = aisle(2, back=True)
    claims = close(graph, 0.0, back=True, turned=math.pi / 2)
    claims.ahead_m = 0.3
    a, b = claims.places(claims.all()[0].candidate)
    np.testing.assert_allclose([a, b], [[0.0, 0.3], [0.0, 0.3]], atol=1e-12)


def test_passes_in_one_direction_tell_nothing_and_change_nothing() -> None:
    graph = aisle(3, back=False)
    claims = close(graph, 0.3, back=False)
    before = graph.factors()
    assert not learn_heard_ahead(graph, claims)
    assert claims.ahead_m == 0.0
    assert graph.factors() == before


def test_without_claims_there_is_nothing_to_learn() -> None:
    graph = aisle(1, back=True)
    graph.settle()
    assert not learn_heard_ahead(graph, WifiClaims(ConsensusConfig(), WifiConfig()))


def test_one_claim_counts_for_less_than_what_is_known_before() -> None:
    graph = aisle(2, back=True)
    claims = WifiClaims(ConsensusConfig(), WifiConfig())
    a, b = (Fingerprint(0, 0, "phone", k, Pose2(), PathPoint(0, Pose2(), k * STEP_M), NOTHING) for k in (20, 138))
    claim = claims.add(0, WifiCandidate(a, b, 0.7, 3 * PRIOR_M, True))
    claim.factor = graph.add(NearFactor(20, 138, a.place, b.place, claims.factor_sigma_m(claim)))
    graph.settle()
    assert not learn_heard_ahead(graph, claims)
