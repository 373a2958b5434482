"""Hypotheses along walls that leave the place open are one place, also those whose scans have yet to be compared."""

import numpy as np
import pytest

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.localization.cluster import cluster_of, evidence_before
from wayfi.frontends.localization.hypotheses import Hypothesis
from wayfi.frontends.localization.local_track import LocalTrack
from wayfi.frontends.localization.localization_config import ClaimConfig
from wayfi.frontends.localization.map_matching import Agreement, Fix
from wayfi.frontends.localization.wifi_support import WifiSupport
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig

CONFIG = ClaimConfig()
KEYFRAMES = 6


@pytest.fixture
def track() -> LocalTrack:
    """A robot that drives on, half a metre a keyframe."""
    track = LocalTrack(LidarConfig(), OdometryConfig(), np.zeros(4))
    for k in range(KEYFRAMES):
        track.add(PathPoint(k * 10**9, Pose2(0.5 * k, 0.0, 0.0), 0.5 * k), None)
    return track


def fix(quality: float, at: Pose2) -> Fix:
    return Fix(at, 1e-3 * np.eye(3), 1.0, 0.0, quality, Agreement.AGREES)


def compared(x: float, keyframe: int, qualities: list[float]) -> Hypothesis:
    """A hypothesis at `x` (m) at a keyframe, after fixes of these qualities."""
    hypothesis = Hypothesis(Pose2(x, 0.0, 0.0), np.diag([0.25, 1e-3, 1e-3]), keyframe)
    for quality in qualities:
        hypothesis.doubt()
        hypothesis.update(fix(quality, hypothesis.T_map_base), 0.0, CONFIG)
    return hypothesis


def test_small_differences_of_fit_are_no_evidence_and_large_ones_are() -> None:
    assert compared(0.0, 5, [0.96] * 30).evidence == compared(0.0, 5, [1.0] * 30).evidence == 0.0
    assert compared(0.0, 5, [0.7] * 4).evidence < -CONFIG.min_gain


def test_a_hypothesis_that_lags_behind_counts_as_much_for_the_place(track: LocalTrack) -> None:
    newest = compared(10.0, KEYFRAMES - 1, [1.0])
    lagging = compared(12.0 - 1.5, KEYFRAMES - 4, [1.0])
    cluster = cluster_of([newest, lagging], track, WifiSupport(()), CONFIG)

    assert cluster is not None
    assert cluster.best is newest
    assert cluster.T_map_base.x == pytest.approx(11.0, abs=0.1)
    assert cluster.covariance[0, 0] > 1.0


@pytest.mark.parametrize(("x", "evidence"), [(11.0, "near"), (30.0, "far")])
def test_a_newcomer_has_the_evidence_of_the_nearest_on_its_way(track: LocalTrack, x: float, evidence: str) -> None:
    hypotheses = {"near": compared(10.0, 1, [0.5] * 2), "far": compared(50.0, 1, [0.9])}
    known = {name: h.evidence for name, h in hypotheses.items()}
    for hypothesis in hypotheses.values():
        hypothesis.move_to_next(track)
        hypothesis.move_to_next(track)
    newcomer = Hypothesis(Pose2(x, 0.0, 0.0), np.eye(3), 1)

    assert known["near"] < known["far"] < 0.0
    assert evidence_before(newcomer, hypotheses.values(), track, CONFIG) == known[evidence]
